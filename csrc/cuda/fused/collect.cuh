// Adds up what the blocks left: gradients, the loss and its terms. Fixed order, in double.
#pragma once

#include "../launch_after.cuh"
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

// Adds values `stride` apart to `sum`, in order; Batch are on their way at a time, then fewer.
template <int Batch = 16, class T>
__device__ void add_values(const T* from, int count, int stride, double& sum) {
#pragma unroll 1
  for (; count >= Batch; count -= Batch) {
    T v[Batch];
#pragma unroll
    for (int i = 0; i < Batch; ++i, from += stride) v[i] = *from;
#pragma unroll
    for (int i = 0; i < Batch; ++i) sum += v[i];
  }
  if constexpr (Batch > 1) add_values<Batch / 2>(from, count, stride, sum);
}

// Sum over a thread's share of the slots.
template <class T>
__device__ double sum_of_share(const T* from, int slots, int stride) {
  const int share = threadIdx.y, count = (slots - share + kShares - 1) / kShares;
  double sum = 0;
  add_values(from + share * stride, count, kShares * stride, sum);
  return sum;
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
  const int i = threadIdx.x;
  const double weight = i < kTerms ? static_cast<double>(a.term_weights.member(e)[i]) : 0.0;
  double sum = 0;
  if (i < kSums) sum = sum_of_share(scratch.sums + e * plan.slots * kSums + i, plan.slots, kSums);
  sum = sum_shares(sum);
  if (threadIdx.y != 0) return;
  if (i >= kTerms && i < kSums) a.grad_theta[e * 3 + i - kTerms] = static_cast<float>(sum);
  const std::int64_t points = i == 1 ? a.m : a.n;
  const double term = points ? sum / (2.0 * static_cast<double>(points)) : 0.0;
  if (i < kTerms) a.terms[e * kTerms + i] = static_cast<float>(term);
  double loss = 0;
  for (int k = 0; k < kTerms; ++k) loss += __shfl_sync(~0u, weight, k) * __shfl_sync(~0u, term, k);
  if (i == 0) a.loss[e] = static_cast<float>(loss);
}

// blockIdx = (hidden weights, then narrow parameters, then the loss; member), blockDim = (32, 8).
template <int H>
__global__ void __launch_bounds__(32 * kShares)
    collect_kernel(const __grid_constant__ DeviceLoss<float> a, const __grid_constant__ Plan plan,
                   const Scratch scratch) {
  wait_for_earlier();
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
    add_values(from, plan.splits, H * H, sum);
    grad[a.net.offset(l) + row * in + column] = static_cast<float>(sum);
    return;
  }
  if (block + 1 == gridDim.x) {
    collect_loss(a, plan, scratch, e);
    return;
  }
  const int i = (block - hidden_blocks) * 32 + threadIdx.x, narrow = plan.narrow();
  const float* from = scratch.narrow_gradients + e * plan.slots * narrow + i;
  double sum = i < narrow ? sum_of_share(from, plan.slots, narrow) : 0;
  sum = sum_shares(sum);
  if (threadIdx.y != 0 || i >= narrow) return;
  const int to = narrow_position<H>(a.net, plan, i);
  if (to >= 0) grad[to] = static_cast<float>(sum);
}

}  // namespace granpinn::cuda::fused
