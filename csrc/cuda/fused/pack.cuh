// Packs the weights in the order in which the tile kernel uses them, padded with zeros.
//
//   stream of a warp:  | W_1 | W_2 | ... | W_{L-1} | W_{L-1}^T | ... | W_2^T | W_1^T |
//                        products 0 .. L-2: forward   L-1 .. 2L-3: backward
//
//   name            shape                            element
//   packed          [part of the inputs][slab]       a stream; tile.split parts, one for a warp
//   float32 stream  [product][k][slab][32]           k: the warp's inputs; `parts` slabs, own first
//   halves stream   [product][stage][4][32 lanes]    8 halves, see MmaEngine
//   narrow          [3 + L + K][H], [kRow]           W_0^T, all biases, W_L; the biases of W_L
#pragma once

#include "../launch_after.cuh"
#include "mma_engine.cuh"
#include "simt_engine.cuh"

namespace granpinn::cuda::fused {

constexpr int kPackThreads = 256;

// Weights of the product with W [out, in] of a layer (forward), or with its transpose.
struct ProductWeights {
  const float* W;
  int in, out;
  bool forward;

  // Weight of input k for output n of the product; zero outside the layer.
  __device__ float operator()(int k, int n) const {
    const int row = forward ? n : k, column = forward ? k : n;
    return row < out && column < in ? W[row * in + column] : 0;
  }
};

__device__ inline ProductWeights product_weights(const DeviceNetwork<float>& net,
                                                 const LaunchPlan& plan, const float* params,
                                                 int layer, bool forward) {
  return {params + plan.offsets[layer], static_cast<int>(net.in(layer)),
          static_cast<int>(net.out(layer)), forward};
}

// A warp's stream: the weights of its slab in all products, for its part of the inputs.
struct WarpStream {
  int slab, part, parts;
  float4* to;
};

// Elements 4 i .. 4 i + 3 of a stream in float32.
template <int H>
__device__ void pack_floats(const DeviceNetwork<float>& net, const LaunchPlan& plan,
                            const float* params, const WarpStream& stream, int i) {
  const int L = plan.hidden, parts = plan.tile.parts;
  constexpr int fours = kSlab * H / 4;  // float4 of a product
  const int product = i / fours, at = i % fours;
  const bool forward = product < L - 1;
  const auto w =
      product_weights(net, plan, params, forward ? product + 1 : 2 * L - 2 - product, forward);
  // `parts` slabs, the warp's own one first: SimtEngine::add_parts
  const int k = stream.slab % parts * (H / parts) + at / (kSlab / 4 * parts);
  const int n = (stream.slab ^ at / (kSlab / 4) % parts) * kSlab + at % (kSlab / 4) * 4;
  stream.to[i] = {w(k, n ^ kSwap), w(k, (n + 1) ^ kSwap), w(k, (n + 2) ^ kSwap),
                  w(k, (n + 3) ^ kSwap)};
}

// Eight weights of a stream in halves, by thread i of the stream. A stage is [4][lane][register],
// with two halves in a register. Its quarters are
//   two pieces:  high m = 0, high m = 1, low m = 0, low m = 1
//   one piece:   inputs 0-3 of a lane m = 0, m = 1; inputs 4-7 of a lane m = 0, m = 1
template <int H>
__device__ void pack_halves(const DeviceNetwork<float>& net, const LaunchPlan& plan,
                            const float* params, const WarpStream& stream, int i) {
  const int L = plan.hidden;
  const int product = i * stream.parts / (kSlab * H / 8), threads = kSlab * H / 8 / stream.parts;
  const int at = i - product * threads, lane = at % 32, m = at / 32 % 2;  // at: in the product
  const bool forward = product < L - 1, pieces = forward || plan.fine_weights;
  const int layer = forward ? product + 1 : 2 * L - 2 - product;
  const int in = static_cast<int>(net.in(layer)), out = static_cast<int>(net.out(layer));
  const int k0 =
      stream.part * (H / stream.parts) +
      (pieces ? at / 64 * 16 + 4 * (lane % 4) : at / 128 * 32 + 8 * (lane % 4) + at / 64 % 2 * 4);
  const int n0 = stream.slab * kSlab + lane / 4 * 4 + 2 * m;
  // inputs k and outputs n are columns and rows of W (forward), or rows and columns (backward)
  const int k_step = forward ? 1 : in, n_step = forward ? in : 1;
  const int k_count = (forward ? in : out) - k0, n_count = (forward ? out : in) - n0;
  const float* from = params + plan.offsets[layer] + (k0 * k_step + n0 * n_step);
  constexpr float scale = 1 << kWeightExponent;
  float v[2][4];
#pragma unroll
  for (int n = 0; n < 2; ++n)
#pragma unroll
    for (int k = 0; k < 4; ++k)
      v[n][k] = k < k_count && n < n_count ? from[k * k_step + n * n_step] : 0;
  unsigned halves[4], rest[4];
#pragma unroll
  for (int r = 0; r < 4; ++r) {
    const float a = scale * v[r % 2][r / 2 * 2], b = scale * v[r % 2][r / 2 * 2 + 1];
    halves[r] = to_halves(a, b);
    rest[r] = rest_of_halves(halves[r], a, b);
  }
  const int begin = pieces ? 2 * product * threads : (product + L - 1) * threads;
  uint4* to = reinterpret_cast<uint4*>(stream.to) + begin + (pieces ? at / 64 * 128 + at % 64 : at);
  to[0] = make_uint4(halves[0], halves[1], halves[2], halves[3]);
  if (pieces) to[64] = make_uint4(rest[0], rest[1], rest[2], rest[3]);
}

// Threads that pack a stream.
template <int H>
GRANPINN_HD std::int64_t pack_threads(const LaunchPlan& plan) {
  return plan.tensor_cores ? plan.products() * kSlab * (H / plan.tile.split) / 8
                           : plan.stream() / 4;
}

// Element i of the narrow parameters (LaunchPlan::narrow); zero for padding.
template <int H>
__device__ float narrow_parameter(const DeviceNetwork<float>& net, const LaunchPlan& plan,
                                  const float* params, int i) {
  const int at = narrow_position<H>(net, plan, i);
  return at < 0 ? 0 : params[at];
}

// blockIdx = (share of a piece, piece, member). Piece 0 is the narrow parameters. Piece 1 + w is
// the stream of warp w.
template <int H, bool TensorCores>
__device__ void pack_share(const DeviceLoss<float>& a, const LaunchPlan& plan,
                           const Scratch& scratch) {
  const std::int64_t e = blockIdx.z;
  const float* params = a.net.params + e * a.net.count;
  const int i = blockIdx.x * kPackThreads + threadIdx.x;
  if (blockIdx.y == 0) {
    if (i < plan.narrow())
      scratch.narrow[e * plan.narrow() + i] = narrow_parameter<H>(a.net, plan, params, i);
    return;
  }
  if (i >= pack_threads<H>(plan)) return;
  const int warp = blockIdx.y - 1, slabs = H / kSlab;
  float* to = scratch.packed + e * plan.packed() + warp * plan.stream();
  const WarpStream stream{warp % slabs, warp / slabs, plan.tile.split,
                          reinterpret_cast<float4*>(to)};
  if constexpr (TensorCores)
    pack_halves<H>(a.net, plan, params, stream, i);
  else
    pack_floats<H>(a.net, plan, params, stream, i);
}

// May run at the same time as draw_batch, if that is the launch before (a.drawn): the two kernels
// share no memory.
template <int H, bool TensorCores>
__global__ void __launch_bounds__(kPackThreads)
    pack_kernel(const __grid_constant__ DeviceLoss<float> a,
                const __grid_constant__ LaunchPlan plan, const Scratch scratch) {
  if (a.drawn)
    let_next_start();
  else
    wait_for_earlier();
  pack_share<H, TensorCores>(a, plan, scratch);
  if (a.drawn) wait_for_earlier();
}

}  // namespace granpinn::cuda::fused
