// Adds up what the blocks left: gradients, the loss and its terms. Fixed order, in double.
#pragma once

#include "layout.h"

namespace granpinn::cuda::fused {

constexpr int kShares = 8;  // threads that share the sum of one parameter

// blockIdx = (32 parameters or, last, the loss; member); blockDim = (32, kShares)
__global__ void collect_kernel(const __grid_constant__ DeviceLoss<float> a,
                               const __grid_constant__ Plan plan, const Scratch scratch) {
  __shared__ double shares[kShares][32];
  const std::int64_t e = blockIdx.y;
  const int L = plan.hidden, H = plan.H, share = threadIdx.y;
  const bool params = blockIdx.x + 1 < gridDim.x;
  const std::int64_t i = std::int64_t(blockIdx.x) * 32 + threadIdx.x;
  double sum = 0;
  if (params && i < a.net.count) {
    int layer = 0;
    std::int64_t at = i;  // within the layer
    for (; at >= (a.net.in(layer) + 1) * a.net.out(layer); ++layer)
      at -= (a.net.in(layer) + 1) * a.net.out(layer);
    const int in = a.net.in(layer), out = a.net.out(layer);
    const bool bias = at >= in * out;
    const int row = bias ? at - in * out : at / in, column = bias ? 0 : at % in;
    const float* from;
    std::int64_t stride;
    int count;
    if (!bias && layer > 0 && layer < L) {
      from = scratch.gradients + (e * (L - 1) + layer - 1) * plan.splits * H * H + row * H + column;
      stride = std::int64_t(H) * H;
      count = plan.splits;
    } else {
      const int place = layer == L ? plan.last() + (bias ? plan.outputs * H + row : row * H + column)
                        : bias     ? plan.bias(layer) + row
                                   : column * H + row;
      from = scratch.narrow_gradients + e * plan.slots * plan.narrow() + place;
      stride = plan.narrow();
      count = plan.slots;
    }
    for (int s = share; s < count; s += kShares) sum += from[s * stride];
  } else if (!params && threadIdx.x < kSums) {
    const double* from = scratch.sums + e * plan.slots * kSums + threadIdx.x;
    for (int s = share; s < plan.slots; s += kShares) sum += from[s * kSums];
  }
  shares[share][threadIdx.x] = sum;
  __syncthreads();
  if (share != 0) return;
  for (int s = 1; s < kShares; ++s) sum += shares[s][threadIdx.x];
  if (params) {
    if (i < a.net.count) a.grad_params[e * a.net.count + i] = static_cast<float>(sum);
    return;
  }
  shares[0][threadIdx.x] = sum;
  __syncwarp();
  if (threadIdx.x >= kTerms && threadIdx.x < kSums)
    a.grad_theta[e * 3 + threadIdx.x - kTerms] = static_cast<float>(sum);
  if (threadIdx.x != 0) return;
  double loss = 0;
  for (int k = 0; k < kTerms; ++k) {
    const std::int64_t points = k == 1 ? a.m : a.n;
    const double term = points ? shares[0][k] / (2.0 * static_cast<double>(points)) : 0.0;
    a.terms[e * kTerms + k] = static_cast<float>(term);
    loss += static_cast<double>(a.term_weights.member(e)[k]) * term;
  }
  a.loss[e] = static_cast<float>(loss);
}

}  // namespace granpinn::cuda::fused
