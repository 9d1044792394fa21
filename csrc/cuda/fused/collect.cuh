// Adds up the results of the blocks: gradients, the loss and its terms. Fixed order, in double.
#pragma once

#include "../launch_after.cuh"
#include "layout.h"

namespace granpinn::cuda::fused {

constexpr int kShares = 8;  // threads that share the sum of one narrow parameter
constexpr int kCollectThreads = 32 * kShares;
constexpr int kEach = 2;  // hidden weights of a thread
constexpr int kBlockWeights = kEach * kCollectThreads;

// Adds `count` values, `stride` apart, to each sum, in order; sum k begins at from + k apart. Batch
// values of each are loaded before they are added, so that the loads overlap.
template <int Batch, int Each, class T>
__device__ void add_values(const T* from, int count, int stride, int apart, double (&sum)[Each]) {
#pragma unroll 1
  for (; count > 0; count -= Batch, from += Batch * stride) {
    T v[Batch][Each];
#pragma unroll
    for (int i = 0; i < Batch; ++i)
#pragma unroll
      for (int k = 0; k < Each; ++k) v[i][k] = i < count ? from[i * stride + k * apart] : T(0);
#pragma unroll
    for (int i = 0; i < Batch * Each; ++i) sum[i % Each] += v[i / Each][i % Each];
  }
}

// Sum over a thread's share of the slots.
template <class T>
__device__ double sum_of_share(const T* from, int slots, int stride) {
  const int share = threadIdx.y, count = (slots - share + kShares - 1) / kShares;
  double sum[1] = {};
  add_values<16>(from + share * stride, count, kShares * stride, 0, sum);
  return sum[0];
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

__device__ inline void collect_loss(const DeviceLoss<float>& a, const LaunchPlan& plan,
                                    const Scratch& scratch, std::int64_t e) {
  const int i = threadIdx.x;
  const double weight = i < kTerms ? static_cast<double>(a.term_weights.member(e)[i]) : 0.0;
  double sum = 0;
  if (i < kSums) sum = sum_of_share(scratch.sums + e * plan.slots * kSums + i, plan.slots, kSums);
  sum = sum_shares(sum);
  if (threadIdx.y != 0) return;
  const int parameters = a.parameters;
  if (i >= kTerms && i < kTerms + parameters)
    a.grad_theta[e * parameters + i - kTerms] = static_cast<float>(sum);
  const std::int64_t points = i == kSurface ? a.m : a.n;
  const double term = points ? sum / (2.0 * static_cast<double>(points)) : 0.0;
  if (i < kTerms) a.terms[e * kTerms + i] = static_cast<float>(term);
  double loss = 0;
  for (int k = 0; k < kTerms; ++k) loss += __shfl_sync(~0u, weight, k) * __shfl_sync(~0u, term, k);
  if (i == 0) a.loss[e] = static_cast<float>(loss);
}

// blockIdx = (hidden weights, then narrow parameters, then the loss; member), blockDim = (32, 8).
template <int H>
__global__ void __launch_bounds__(kCollectThreads)
    collect_kernel(const __grid_constant__ DeviceLoss<float> a,
                   const __grid_constant__ LaunchPlan plan, const Scratch scratch) {
  wait_for_earlier();
  const std::int64_t e = blockIdx.y;
  const int L = plan.hidden, hidden_blocks = (L - 1) * H * H / kBlockWeights;
  const int block = blockIdx.x;
  float* grad = a.grad_params + e * a.net.count;
  if (block < hidden_blocks) {
    const int i = block * kBlockWeights + threadIdx.y * 32 + threadIdx.x;
    const int l = i / (H * H) + 1, in = a.net.in(l), out = a.net.out(l);
    const float* from =
        scratch.gradients + (e * (L - 1) + l - 1) * plan.splits * H * H + i % (H * H);
    double sum[kEach] = {};
    add_values<8>(from, plan.splits, H * H, kCollectThreads, sum);
#pragma unroll
    for (int k = 0; k < kEach; ++k) {
      const int row = i / H % H + k * kCollectThreads / H, column = i % H;
      if (row < out && column < in)
        grad[plan.offsets[l] + row * in + column] = static_cast<float>(sum[k]);
    }
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
