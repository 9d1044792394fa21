// The values of a tile that a thread owns: `neurons` consecutive neurons of a slab, for some points
// and all channels of these points.
//
// A warp owns a slab of 32 neurons. Its lanes are 8 groups of neurons x 4 groups of points:
//
//                     plain                    Paired
//   point_lane        0   1   2   3            0   1   2   3
//   neurons  0 ..  3  0   1   2   3            0   1   4   5      entries: lanes
//   neurons  4 ..  7  4   5   6   7            2   3   6   7
//   neurons  8 .. 11  8   9  10  11            8   9  12  13
//     ...                                        ...
//
// If Paired, lanes i and i ^ 1 read the same weights from shared memory, and lanes i and i ^ 2 the
// same activations. The hardware then merges 16-byte loads in pairs.
//
// With Split = 2, two warps share a slab. Each sums over half of the inputs for all 32 neurons;
// `exchange` then leaves two of every four neurons to each warp.
//
//   name      value        meaning
//   threads   H * Split    of a block
//   neurons   4 / Split    of a thread, from `column()` on
//   slab()    0 .. H/32-1  slab of the warp
//   part()    0 .. Split-1 number of the warp among those of its slab
#pragma once

#include "weight_stream.cuh"

namespace granpinn::cuda::fused {

__device__ inline float add_lanes(float a, int apart) { return a + __shfl_xor_sync(~0u, a, apart); }
__device__ inline float element(const float4& v, int i) {
  return i == 0 ? v.x : i == 1 ? v.y : i == 2 ? v.z : v.w;
}

template <int Width, int Split, bool Paired = false>
struct Lanes {
  static constexpr int H = Width;
  static constexpr int split = Split;
  static constexpr int threads = H * Split;
  static constexpr int warps = threads / 32;
  static constexpr int neurons = 4 / Split;
  static constexpr int second_point = Paired ? 4 : 2, first_neuron = Paired ? 2 : 4;  // lanes apart

  static __device__ int lane() { return threadIdx.x % 32; }
  static __device__ int point_lane() {
    return Paired ? lane() % 2 + lane() / 4 % 2 * 2 : lane() % 4;
  }
  static __device__ int neuron_lane() {
    return Paired ? lane() / 2 % 2 + lane() / 8 * 2 : lane() / 4;
  }
  static __device__ int slab() { return threadIdx.x / 32 % (H / kSlab); }
  static __device__ int part() { return threadIdx.x / H; }
  static __device__ int column() { return slab() * kSlab + neuron_lane() * 4 + part() * neurons; }

  // Sums over the lanes with the same neurons; point_lane j returns the sum of a[j], j < neurons.
  static __device__ float sum_points(const float (&a)[neurons]) {
    if constexpr (neurons == 4)
      return halve(halve(a[0], a[2], second_point), halve(a[1], a[3], second_point), 1);
    else
      return add_lanes(halve(a[0], a[1], 1), second_point);
  }
  // Sums over the lanes with the same points; of eight sums, neuron_lane n returns that of a[n].
  static __device__ float sum_neurons(float a) {
    return add_lanes(add_lanes(add_lanes(a, first_neuron), 8), 16);
  }
  static __device__ float sum_neurons(const float (&a)[8]) {
    float v[4];
#pragma unroll
    for (int i = 0; i < 4; ++i) v[i] = halve(a[i], a[i + 4], 16);
    return halve(halve(v[0], v[2], 8), halve(v[1], v[3], 8), first_neuron);
  }
  // Sums over two lanes that are `apart`: the lower lane returns that of a, the upper that of b.
  static __device__ float halve(float a, float b, int apart) {
    const bool upper = lane() & apart;
    return (upper ? b : a) + __shfl_xor_sync(~0u, upper ? a : b, apart);
  }

  // The values of this thread's neurons, from a row of H.
  static __device__ void load(const float* row, float (&v)[neurons]) { copy(row + column(), v); }

  static __device__ void copy(const float* from, float (&v)[neurons]) {
    if constexpr (neurons == 4) {
      const float4 a = *reinterpret_cast<const float4*>(from);
      v[0] = a.x, v[1] = a.y, v[2] = a.z, v[3] = a.w;
    } else {
      const float2 a = *reinterpret_cast<const float2*>(from);
      v[0] = a.x, v[1] = a.y;
    }
  }
  static __device__ void copy_to(float* to, const float (&v)[neurons]) {
    if constexpr (neurons == 4)
      *reinterpret_cast<float4*>(to) = make_float4(v[0], v[1], v[2], v[3]);
    else
      *reinterpret_cast<float2*>(to) = make_float2(v[0], v[1]);
  }

  // Adds the sums of the two warps of a slab. Each thread has `half`, sums over half of the inputs
  // for four neurons. It sends two of them, and receives the other half of its own two.
  // memory: shared, [Rows][2 warps of a slab][H], written by all threads.
  template <int Rows>
  static __device__ void exchange(float2* memory, const float (&half)[Rows][4],
                                  float (&whole)[Rows][neurons]) {
    if constexpr (Split == 1) {
#pragma unroll
      for (int i = 0; i < Rows * 4; ++i) whole[i / 4][i % 4] = half[i / 4][i % 4];
    } else {
      const int own = part(), place = slab() * 32 + lane();
#pragma unroll
      for (int i = 0; i < Rows; ++i)
        memory[(i * 2 + 1 - own) * H + place] =
            own ? make_float2(half[i][0], half[i][1]) : make_float2(half[i][2], half[i][3]);
      asm volatile("bar.sync %0, 64;" ::"r"(1 + slab()) : "memory");
#pragma unroll
      for (int i = 0; i < Rows; ++i) {
        const float2 other = memory[(i * 2 + own) * H + place];
        whole[i][0] = (own ? half[i][2] : half[i][0]) + other.x;
        whole[i][1] = (own ? half[i][3] : half[i][1]) + other.y;
      }
    }
  }
};

}  // namespace granpinn::cuda::fused
