// Weights in the order of their use, padded with zeros.
#pragma once

#include "../launch_after.cuh"
#include "mma_engine.cuh"
#include "simt_engine.cuh"

namespace granpinn::cuda::fused {

constexpr int kPackThreads = 256;

// Weights of the product with a layer's matrix W [out, in], forward, or with its transpose.
struct ProductWeights {
  const float* W;
  int in, out;
  bool forward;

  // From input k of the product to its output n; zero beyond the layer.
  __device__ float operator()(int k, int n) const {
    const int row = forward ? n : k, column = forward ? k : n;
    return row < out && column < in ? W[row * in + column] : 0;
  }
};

__device__ inline ProductWeights product_weights(const DeviceNetwork<float>& net,
                                                 const float* params, int layer, bool forward) {
  return {params + net.offset(layer), static_cast<int>(net.in(layer)),
          static_cast<int>(net.out(layer)), forward};
}

// Elements 4 i .. 4 i + 3 of a warp's stream: the slab's weights of all products, from its part of
// the inputs.
template <int H, bool TensorCores>
__device__ float4 packed_weights(const DeviceNetwork<float>& net, const float* params, int L,
                                 int slab, int part, int parts, bool compensated, int i) {
  const int inputs = H / parts;
  if (!TensorCores) {
    constexpr int fours = kSlab * H / 4;  // of a product
    const int product = i / fours, at = i % fours;
    const bool forward = product < L - 1;
    const auto w =
        product_weights(net, params, forward ? product + 1 : 2 * L - 2 - product, forward);
    // of `parts` slabs, the warp's own first, see SimtEngine::add_parts
    const int k = slab % parts * inputs + at / (kSlab / 4 * parts);
    const int n = (slab ^ at / (kSlab / 4) % parts) * kSlab + at % (kSlab / 4) * 4;
    return {w(k, n ^ kSwap), w(k, (n + 1) ^ kSwap), w(k, (n + 2) ^ kSwap), w(k, (n + 3) ^ kSwap)};
  }
  const int fours = kSlab * inputs / 4;  // of a product in float32
  // [quarter of the stage][lane][register]: two halves in each, see MmaEngine::multiply
  const bool forward = i < (L - 1) * fours;
  const bool pieces = forward || compensated;
  const int size = pieces ? fours : fours / 2, block = pieces ? 16 : 32;
  const int at = forward ? i : i - (L - 1) * fours;
  const int product = at / size, stage = at % size / 128;
  const auto w = product_weights(net, params, forward ? product + 1 : L - 1 - product, forward);
  const int lane = at % 32, m = at / 32 % 2, second = at / 64 % 2;
  const int k0 =
      part * inputs + stage * block + (pieces ? 4 * (lane % 4) : 8 * (lane % 4) + 4 * second);
  const int n0 = slab * kSlab + lane / 4 * 4 + 2 * m;
  constexpr float scale = 1 << kWeightExponent;
  float v[4][2];
#pragma unroll
  for (int r = 0; r < 4; ++r)
#pragma unroll
    for (int j = 0; j < 2; ++j) v[r][j] = scale * w(k0 + r / 2 * 2 + j, n0 + r % 2);
  float packed[4];
#pragma unroll
  for (int r = 0; r < 4; ++r) {
    const unsigned halves = to_halves(v[r][0], v[r][1]);
    packed[r] =
        __uint_as_float(pieces && second ? rest_of_halves(halves, v[r][0], v[r][1]) : halves);
  }
  return {packed[0], packed[1], packed[2], packed[3]};
}

// Element i of the narrow parameters (Plan::narrow), zero for padding.
template <int H>
__device__ float narrow_parameter(const DeviceNetwork<float>& net, const float* params, int L,
                                  int K, int i) {
  const int row = i / H, n = i % H;
  if (row < 3) return n < net.out(0) ? params[3 * n + row] : 0;
  if (row < 3 + L) {
    const int layer = row - 3;
    return n < net.out(layer) ? params[net.offset(layer) + net.in(layer)*net.out(layer) + n] : 0;
  }
  if (row < 3 + L + K)
    return n < net.in(L) ? params[net.offset(L) + (row - 3 - L) * net.in(L) + n] : 0;
  return n < K ? params[net.offset(L) + net.in(L)*K + n] : 0;
}

// blockIdx = (share of a piece, piece, member). Piece 0 is the narrow parameters; the others are
// the warps' streams, [part of the inputs][slab], each [product][stage].
template <int H, bool TensorCores>
__global__ void __launch_bounds__(kPackThreads)
    pack_kernel(const __grid_constant__ DeviceLoss<float> a, const __grid_constant__ Plan plan,
                const Scratch scratch) {
  wait_for_earlier();
  const std::int64_t e = blockIdx.z;
  const float* params = a.net.params + e * a.net.count;
  const int L = plan.hidden, i = blockIdx.x * kPackThreads + threadIdx.x;
  if (blockIdx.y == 0) {
    if (i < plan.narrow())
      scratch.narrow[e * plan.narrow() + i] =
          narrow_parameter<H>(a.net, params, L, plan.outputs, i);
    return;
  }
  const int warp = blockIdx.y - 1, slab = warp % (H / kSlab), part = warp / (H / kSlab);
  const std::int64_t length = plan.stream();
  if (4 * i < length)
    reinterpret_cast<float4*>(scratch.packed + e * plan.packed() + warp * length)[i] =
        packed_weights<H, TensorCores>(a.net, params, L, slab, part,
                                       TensorCores ? plan.tile.split : plan.tile.parts,
                                       plan.compensated, i);
}

}  // namespace granpinn::cuda::fused
