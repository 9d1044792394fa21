// Weights in the order of their use, padded with zeros.
#pragma once

#include "mma_engine.cuh"
#include "simt_engine.cuh"

namespace granpinn::cuda::fused {

// Weight from input k to output n of a product: forward through a layer, or backward.
__device__ inline float weight(const DeviceNetwork<float>& net, const float* params, int layer,
                               bool forward, int k, int n) {
  const int in = net.in(layer), out = net.out(layer);
  const int row = forward ? n : k, column = forward ? k : n;
  return row < out && column < in ? params[net.offset(layer) + row * in + column] : 0;
}

// Element `at` of a warp's stream: the slab's weights of all products, from its part of the inputs.
template <int H, bool TensorCores>
__device__ float packed_weight(const DeviceNetwork<float>& net, const float* params, int L,
                               int slab, int part, int parts, int at) {
  const int inputs = H / parts;
  if (!TensorCores) {
    const int product = at / (kSlab * inputs), i = at % (kSlab * inputs);
    const bool forward = product < L - 1;
    return weight(net, params, forward ? product + 1 : 2 * L - 2 - product, forward,
                  part * inputs + i / kSlab, slab * kSlab + i % kSlab);
  }
  // [quarter of the stage][lane][register]: two halves in each, see MmaEngine::multiply
  const int all_forward = (L - 1) * kSlab * inputs;
  const bool forward = at < all_forward;
  const int size = forward ? kSlab * inputs : kSlab * inputs / 2, block = forward ? 16 : 32;
  if (!forward) at -= all_forward;
  const int product = at / size, stage = at % size / 512, s = at % 512;
  const int layer = forward ? product + 1 : L - 1 - product;
  const int quarter = s / 128, lane = s % 128 / 4, pair = s % 4 / 2, row = s % 2;
  const int m = quarter % 2, second = quarter / 2;
  const int k = part * inputs + stage * block +
                (forward ? 4 * (lane % 4) : 8 * (lane % 4) + 4 * second) + 2 * pair;
  const int n = slab * kSlab + lane / 4 * 4 + 2 * m + row;
  constexpr float scale = 1 << kWeightExponent;
  const float w0 = scale * weight(net, params, layer, forward, k, n);
  const float w1 = scale * weight(net, params, layer, forward, k + 1, n);
  const unsigned halves = to_halves(w0, w1);
  return __uint_as_float(forward && second ? rest_of_halves(halves, w0, w1) : halves);
}

// blockIdx = (share of the work, member)
template <int H, bool TensorCores>
__global__ void pack_kernel(const __grid_constant__ DeviceLoss<float> a,
                            const __grid_constant__ Plan plan, const Scratch scratch) {
  const std::int64_t e = blockIdx.y;
  const float* params = a.net.params + e * a.net.count;
  const int L = plan.hidden, first = blockIdx.x * blockDim.x + threadIdx.x;
  const int stride = gridDim.x * blockDim.x;

  // [part of the inputs][slab][product][stage]: each warp's stream in one piece
  const int count = static_cast<int>(plan.packed()),
            stream_length = static_cast<int>(plan.stream());
  float* packed = scratch.packed + e * plan.packed();
  for (int i = first; i < count; i += stride) {
    const int warp = i / stream_length, slab = warp % (H / kSlab), part = warp / (H / kSlab);
    packed[i] = packed_weight<H, TensorCores>(a.net, params, L, slab, part, plan.tile.split,
                                              i % stream_length);
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
