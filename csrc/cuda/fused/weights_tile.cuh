// The tile of weights that a block of the weights kernel computes, in plain float32 or on tensor
// cores. weights_kernel.cuh has the equation and the diagram.
//
//                       SimtWeights                       MmaWeights
//   element             float32                           half, with exponents of scales
//   M x N of a block    64, 128, 256 x 128                64, 128, 256 x 128
//   rows of a stage     32, 32, 16                        128, 64, 64
//   groups of threads   4, 2, 1                           4, 2, 1
//   rows of a step      1                                 16
//   weights of a thread 8 x 16: [2][4] x [4][4]           4 x 8 tiles of m16n8k16, 4 each
//   operands            g[2], a[4]: float4                g[4], a[4]: 16 x 16 fragments
//   Run (neighbours)    float4                            float2
//
// A warp computes 64 x 64 weights, in SimtWeights with 8 x 4 lanes:
//
//          columns  0   4   8  12 | 16 ..          lane's columns: 4 each from 0, 16, 32, 48 on
//   rows  0 ..  3   0   1   4   5 | again          lane's rows:    4 each from 0, 32 on
//   rows  4 ..  7   2   3   6   7 |
//   rows  8 .. 11   8   9  12  13 |
//     ...                         |                entries: lanes
#pragma once

#include "mma_engine.cuh"
#include "simt_engine.cuh"

namespace granpinn::cuda::fused {

// M x N weights. A stage of the ring has StageRows rows, [G: M][A: N][Padding] each. For halves,
// the exponents of the scales of G and of A follow: [2][StageRows / 4].
template <class Element_, int Rows, int StageRows, int Padding>
struct WeightsTile {
  using Element = Element_;
  static constexpr bool scaled = sizeof(Element) == 2;
  static constexpr int threads = 256, M = Rows, N = 128;
  static constexpr int values = 128;  // weights of a thread
  static constexpr int groups = threads * values / (M * N);
  static constexpr int stage_rows = StageRows;
  static constexpr int ld = M + N + Padding;
  static constexpr int scales = StageRows * ld;  // position in a stage
  static constexpr int stage_size = scales + (scaled ? StageRows : 0);
  static constexpr int memory(int stages) {  // bytes: the ring, then the sums of all groups but one
    const int ring = stages * stage_size * int{sizeof(Element)}, sums = 4 * (groups - 1) * M * N;
    return ring > sums ? ring : sums;
  }

  // Position of the warp's 64 x 64 weights in the tile.
  static __device__ int warp() { return threadIdx.x % (threads / groups) / 32; }
  static __device__ int warp_row() { return warp() / (N / 64) * 64; }
  static __device__ int warp_column() { return warp() % (N / 64) * 64; }
};

__device__ inline float2 operator+(const float2& a, const float2& b) {
  return {a.x + b.x, a.y + b.y};
}
__device__ inline float4 operator+(const float4& a, const float4& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w};
}
__device__ inline float2 operator*(const float2& a, float b) { return {a.x * b, a.y * b}; }
__device__ inline float4 operator*(const float4& a, float b) {
  return {a.x * b, a.y * b, a.z * b, a.w * b};
}

// Plain float32. Columns change places in pairs (kSwap), so that a sum and its factor are in
// different banks of registers: see SimtEngine.
template <int Rows, int StageRows>
struct SimtWeights : WeightsTile<float, Rows, StageRows, 0> {
  using Tile = WeightsTile<float, Rows, StageRows, 0>;
  using Tile::values, Tile::M, Tile::ld;
  static constexpr int step_rows = 1;
  using Run = float4;  // neighbouring weights of a thread

  // Lanes i and i ^ 1 have the same rows, lanes i and i ^ 2 the same columns: the hardware then
  // merges 16-byte loads in pairs.
  static __device__ int row0() {
    const int lane = threadIdx.x % 32;
    return Tile::warp_row() + (lane / 2 % 2 + lane / 8 * 2) * 4;
  }
  static __device__ int column0() {
    const int lane = threadIdx.x % 32;
    return Tile::warp_column() + (lane % 2 + lane / 4 % 2 * 2) * 4;
  }

  struct Operands {
    float4 g[2], a[4];
  };
  static __device__ void load(const float* stage, int first, Operands& o) {
    const float* row = stage + first * ld;
#pragma unroll
    for (int i = 0; i < 2; ++i) o.g[i] = *reinterpret_cast<const float4*>(row + row0() + i * 32);
#pragma unroll
    for (int j = 0; j < 4; ++j)
      o.a[j] = *reinterpret_cast<const float4*>(row + M + column0() + j * 16);
  }
  static __device__ void multiply(const Operands& o, int, float (&sum)[values]) {
#pragma unroll
    for (int v = 0; v < values; ++v)
      sum[v] =
          fmaf(element(o.g[v / 64], v / 16 % 4), element(o.a[v % 16 / 4], v % 4 ^ kSwap), sum[v]);
  }

  static __device__ Run run(const float (&sum)[values], int q) {
    return {sum[4 * q], sum[4 * q + 1], sum[4 * q + 2], sum[4 * q + 3]};
  }
  static __device__ Run in_order(const Run& v) { return {v.y, v.x, v.w, v.z}; }
  static __device__ int row_of(int q) { return row0() + q / 16 * 32 + q / 4 % 4; }
  static __device__ int column_of(int q) { return column0() + q % 4 * 16; }
};

// Loads four 8 x 8 matrices of halves from shared memory, transposed. row: address of a row of 8,
// a different one in each lane.
__device__ inline uint4 load_transposed(const __half* row) {
  uint4 v;
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.trans.shared.b16 {%0,%1,%2,%3}, [%4];"
               : "=r"(v.x), "=r"(v.y), "=r"(v.z), "=r"(v.w)
               : "r"(static_cast<unsigned>(__cvta_generic_to_shared(row)))
               : "memory");
  return v;
}
__device__ inline unsigned times(unsigned halves, __half2 factor) {
  const __half2 product = __hmul2(*reinterpret_cast<const __half2*>(&halves), factor);
  return *reinterpret_cast<const unsigned*>(&product);
}

// Tensor cores, halves. Every four rows have their own scales 2^s, of G and of A. The halves of G
// are multiplied by 2^(least - sum of the two exponents) <= 1, so that all products have the same
// scale 2^least. The bits that small numbers lose are far below the rounding of the largest.
template <int Rows, int StageRows>
struct MmaWeights : WeightsTile<__half, Rows, StageRows, 8> {
  using Tile = WeightsTile<__half, Rows, StageRows, 8>;
  using Tile::values, Tile::M, Tile::ld;
  static constexpr int step_rows = 16;
  using Run = float2;

  struct Operands {
    uint4 g[4], a[4];
    int exponents[2];  // sums for G and A of rows 2 t, 2 t + 1 and 2 t + 8, 2 t + 9; t = lane % 4
  };
  static __device__ void load(const __half* stage, int first, Operands& o) {
    const int lane = threadIdx.x % 32, eight = lane / 8 % 2 * 8, other = lane / 16 * 8;
    const __half* row = stage + (first + lane % 8) * ld;
#pragma unroll
    for (int m = 0; m < 4; ++m)
      o.g[m] = load_transposed(row + other * ld + Tile::warp_row() + m * 16 + eight);
#pragma unroll
    for (int n = 0; n < 4; ++n)
      o.a[n] = load_transposed(row + eight * ld + M + Tile::warp_column() + n * 16 + other);
    const int* scales = reinterpret_cast<const int*>(stage + Tile::scales) + first / 4;
#pragma unroll
    for (int i = 0; i < 2; ++i) {
      const int* at = scales + lane % 4 / 2 + 2 * i;
      o.exponents[i] = at[0] + at[StageRows / 4];
    }
  }
  // least: the smallest sum of two exponents in the block's rows
  static __device__ void multiply(const Operands& o, int least, float (&sum)[values]) {
    __half2 factor[2];
#pragma unroll
    for (int i = 0; i < 2; ++i)
      factor[i] = __float2half2_rn(power_of_two(-min(max(o.exponents[i] - least, 0), 30)));
#pragma unroll
    for (int m = 0; m < 4; ++m) {
      const uint4 g{times(o.g[m].x, factor[0]), times(o.g[m].y, factor[0]),
                    times(o.g[m].z, factor[1]), times(o.g[m].w, factor[1])};
#pragma unroll
      for (int n = 0; n < 8; ++n) {
        float (&d)[4] = reinterpret_cast<float (&)[4]>(sum[(m * 8 + n) * 4]);
        const uint4& a = o.a[n / 2];
        mma_f16(d, g, n % 2 ? a.z : a.x, n % 2 ? a.w : a.y, d);
      }
    }
  }

  static __device__ Run run(const float (&sum)[values], int q) {
    return {sum[2 * q], sum[2 * q + 1]};
  }
  static __device__ Run in_order(const Run& v) { return v; }
  static __device__ int row_of(int q) {
    return Tile::warp_row() + q / 16 * 16 + q % 2 * 8 + threadIdx.x % 32 / 4;
  }
  static __device__ int column_of(int q) {
    return Tile::warp_column() + q / 2 % 8 * 8 + threadIdx.x % 4 * 2;
  }
};

}  // namespace granpinn::cuda::fused
