// Adds up what the blocks left: gradients, the loss and its terms. Fixed order, in double.
#pragma once

#include "layout.h"

namespace granpinn::cuda::fused {

constexpr int kShares = 8;  // threads that share the sum of one narrow parameter

// Position of a narrow parameter (Plan::narrow) among the network's, -1 for padding.
template <int H>
__device__ int narrow_position(const DeviceNetwork<float>& net, const Plan& plan, int i) {
  const int row = i / H, n = i % H, L = plan.hidden, K = plan.outputs;
  if (row < 3) return n < net.out(0) ? 3 * n + row : -1;
  if (row < 3 + L) {
    const int l = row - 3;
    return n < net.out(l) ? int(net.offset(l) + net.in(l)*net.out(l)) + n : -1;
  }
  if (row < 3 + L + K)
    return n < net.in(L) ? int(net.offset(L) + (row - 3 - L) * net.in(L)) + n : -1;
  return n < K ? int(net.offset(L) + net.in(L)*K) + n : -1;
}

// Sum over the threads y of a block; valid for y = 0.
__device__ inline double sum_shares(double sum) {
  __shared__ double shares[kShares][32];
  shares[threadIdx.y][threadIdx.x] = sum;
  __syncthreads();
  if (threadIdx.y == 0)
    for (int s = 1; s < kShares; ++s) sum += shares[s][threadIdx.x];
  return sum;
}

__device__ inline void collect_loss(const DeviceLoss<float>& a, const Plan& plan,
                                    const Scratch& scratch, std::int64_t e) {
  double sum = 0;
  if (threadIdx.x < kSums)
    for (int s = threadIdx.y; s < plan.slots; s += kShares)
      sum += scratch.sums[(e * plan.slots + s) * kSums + threadIdx.x];
  sum = sum_shares(sum);
  if (threadIdx.y != 0) return;
  if (threadIdx.x >= kTerms && threadIdx.x < kSums)
    a.grad_theta[e * 3 + threadIdx.x - kTerms] = static_cast<float>(sum);
  double loss = 0;
  for (int k = 0; k < kTerms; ++k) {
    const std::int64_t points = k == 1 ? a.m : a.n;
    const double square = __shfl_sync(~0u, sum, k);
    const double term = points ? square / (2.0 * static_cast<double>(points)) : 0.0;
    if (threadIdx.x == k) a.terms[e * kTerms + k] = static_cast<float>(term);
    loss += static_cast<double>(a.term_weights.member(e)[k]) * term;
  }
  if (threadIdx.x == 0) a.loss[e] = static_cast<float>(loss);
}

// blockIdx = (hidden weights, then narrow parameters, then the loss; member), blockDim = (32, 8).
template <int H>
__global__ void collect_kernel(const __grid_constant__ DeviceLoss<float> a,
                               const __grid_constant__ Plan plan, const Scratch scratch) {
  const std::int64_t e = blockIdx.y;
  const int L = plan.hidden, hidden_blocks = (L - 1) * H * H / (32 * kShares);
  const int block = blockIdx.x;
  float* grad = a.grad_params + e * a.net.count;
  if (block < hidden_blocks) {
    const int i = block * 32 * kShares + threadIdx.y * 32 + threadIdx.x;
    const int l = i / (H * H) + 1, row = i / H % H, column = i % H;
    const int in = a.net.in(l), out = a.net.out(l);
    if (row >= out || column >= in) return;
    const float* from =
        scratch.gradients + (e * (L - 1) + l - 1) * plan.splits * H * H + i % (H * H);
    double sum = 0;
#pragma unroll 4
    for (int s = 0; s < plan.splits; ++s) sum += from[std::int64_t(s) * H * H];
    grad[a.net.offset(l) + row * in + column] = static_cast<float>(sum);
    return;
  }
  if (block + 1 == gridDim.x) {
    collect_loss(a, plan, scratch, e);
    return;
  }
  const int i = (block - hidden_blocks) * 32 + threadIdx.x, narrow = plan.narrow();
  const float* from = scratch.narrow_gradients + e * plan.slots * narrow + i;
  double sum = 0;
  if (i < narrow) {
#pragma unroll 4
    for (int s = threadIdx.y; s < plan.slots; s += kShares) sum += from[s * narrow];
  }
  sum = sum_shares(sum);
  if (threadIdx.y != 0 || i >= narrow) return;
  const int to = narrow_position<H>(a.net, plan, i);
  if (to >= 0) grad[to] = static_cast<float>(sum);
}

}  // namespace granpinn::cuda::fused
