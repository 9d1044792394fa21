// Weights in the order of their use, padded with zeros.
#pragma once

#include "mma_engine.cuh"
#include "simt_engine.cuh"

namespace granpinn::cuda::fused {

// blockIdx = (share of the work, member)
template <int H, bool TensorCores>
__global__ void pack_kernel(const __grid_constant__ DeviceLoss<float> a,
                            const __grid_constant__ Plan plan, const Scratch scratch) {
  const std::int64_t e = blockIdx.y;
  const float* params = a.net.params + e * a.net.count;
  const int L = plan.hidden, first = blockIdx.x * blockDim.x + threadIdx.x;
  const int stride = gridDim.x * blockDim.x;

  float* packed = scratch.packed + e * plan.packed();
  for (int i = first; i < plan.products() * H * H; i += stride) {
    // [slab][product][block][kStage]: each warp's stream in one piece
    const int block = i / kStage, slab = block / (plan.products() * (H / kBlockK));
    const int product = block / (H / kBlockK) % plan.products();
    const int k0 = block % (H / kBlockK) * kBlockK, s = i % kStage;
    const bool forward = product < L - 1;
    const int layer = forward ? product + 1 : 2 * L - 2 - product;
    const int in = a.net.in(layer), out = a.net.out(layer);
    int k, n;
    if (TensorCores) {
      const int part = s % 4, lane = s / 4 % 32, m = s / 128;
      k = k0 + lane % 4 + part / 2 * 4;
      n = slab * kSlab + m * 16 + lane / 4 + part % 2 * 8;
    } else {
      k = k0 + s / kSlab;
      n = slab * kSlab + s % kSlab;
    }
    const int row = forward ? n : k, column = forward ? k : n;
    float w = row < out && column < in ? params[a.net.offset(layer) + row * in + column] : 0;
    if (TensorCores && !forward) w = to_tf32(w);
    packed[i] = w;
  }

  float* narrow = scratch.narrow + e * plan.narrow();
  for (int i = first; i < plan.narrow(); i += stride) {
    const int row = i / H, n = i % H, K = plan.outputs;
    float w = 0;
    if (row < 3) {
      if (n < a.net.out(0)) w = params[3 * n + row];
    } else if (row < 3 + L) {
      const int layer = row - 3;
      if (n < a.net.out(layer))
        w = params[a.net.offset(layer) + a.net.in(layer)*a.net.out(layer) + n];
    } else if (row < 3 + L + K) {
      if (n < a.net.in(L)) w = params[a.net.offset(L) + (row - 3 - L) * a.net.in(L) + n];
    } else if (n < K) {
      w = params[a.net.offset(L) + a.net.in(L)*K + n];
    }
    narrow[i] = w;
  }
}

}  // namespace granpinn::cuda::fused
