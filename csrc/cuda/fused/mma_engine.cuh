// Products of a tile on tensor cores: float32-grade forward, TF32 backward.
//
// z^T = W a^T with mma.m16n8k8: neurons are the rows of the tensor cores' tile, so a weight
// fragment is used by one warp alone and comes straight from its stream, and a thread ends up with
// all channels of its points. Forward, each operand is split into two TF32 numbers; of the four
// products the smallest is left out, and the tensor cores' sums over 16 terms are added in float32
// registers: added up inside, they would be truncated. Backward operands are rounded to nearest.
#pragma once

#include "weight_stream.cuh"

namespace granpinn::cuda::fused {

// Rounded to the ten mantissa bits of TF32, halves away from zero. (The compiler's own conversion
// takes twice as many instructions, to keep the payload of a NaN.)
__device__ inline float to_tf32(float a) {
  return __uint_as_float((__float_as_uint(a) + 0x1000u) & 0xffffe000u);
}

__device__ inline void mma_tf32(float* d, const float (&a)[4], const float (&b)[2]) {
  asm("mma.sync.aligned.m16n8k8.row.col.f32.tf32.tf32.f32 {%0,%1,%2,%3}, {%4,%5,%6,%7}, {%8,%9}, "
      "{%0,%1,%2,%3};"
      : "+f"(d[0]), "+f"(d[1]), "+f"(d[2]), "+f"(d[3])
      : "r"(__float_as_uint(a[0])), "r"(__float_as_uint(a[1])), "r"(__float_as_uint(a[2])),
        "r"(__float_as_uint(a[3])), "r"(__float_as_uint(b[0])), "r"(__float_as_uint(b[1])));
}

// Points: 4, or a multiple of 8.
template <int Width, int Channels, int Points>
struct MmaEngine {
  static constexpr int H = Width;
  static constexpr int C = Channels;
  static constexpr int PT = Points;
  static constexpr bool quad = PT == 4;  // a tensor-core tile then holds two channels of 4 points
  static constexpr int CP = quad ? (C + 1) / 2 * 2 : C;
  static constexpr int PPT = quad ? 1 : PT / 4;
  static constexpr int R = CP * PT;
  static constexpr int tiles = R / 8;
  static constexpr int ld = H + 4;
  static constexpr bool tensor_cores = true;
  static constexpr int panel_size = 2 * R * ld;  // rounded values, then what rounding took away
  using Stream = WeightStream<H, 4>;
  using Values = float[CP][PPT][4];

  static __device__ int lane() { return threadIdx.x % 32; }
  static __device__ int point_lane() { return lane() % 4; }
  static __device__ int neuron_lane() { return lane() / 4; }
  static __device__ float sum_points(float a) { return add_lanes(add_lanes(a, 1), 2); }
  static __device__ float sum_neurons(float a) {
    return add_lanes(add_lanes(add_lanes(a, 4), 8), 16);
  }
  static __device__ int point(int q) {
    return quad ? lane() % 4 : q / 2 * 8 + lane() % 4 * 2 + q % 2;
  }
  static __device__ int row(int c, int q) { return c * PT + point(q); }
  static __device__ int column(int j) { return threadIdx.x / 32 * kSlab + j * 8 + lane() / 4; }

  static __device__ void load(const float* row, float (&v)[4]) {
#pragma unroll
    for (int j = 0; j < 4; ++j) v[j] = row[column(j)];
  }
  static __device__ void store(float* row, const float (&v)[4]) {
#pragma unroll
    for (int j = 0; j < 4; ++j) row[column(j)] = v[j];
  }
  // Four neurons of a row into the panel, as operands of the next product; `kept` is what the
  // weights kernel gets.
  template <bool Forward>
  static __device__ void put(float* panel, int row, const float (&a)[4], float (&kept)[4]) {
#pragma unroll
    for (int j = 0; j < 4; ++j) kept[j] = to_tf32(a[j]);
    store(panel + row * ld, kept);
    if (!Forward) return;
    float rest[4];
#pragma unroll
    for (int j = 0; j < 4; ++j) rest[j] = to_tf32(a[j] - kept[j]);
    store(panel + (R + row) * ld, rest);
  }

  // z[row][neuron] = sum_k panel[row][k] W[k][neuron]
  template <bool Forward>
  static __device__ void multiply(const float* panel, Stream& weights, Values& z) {
#pragma unroll
    for (int c = 0; c < CP; ++c)
#pragma unroll
      for (int q = 0; q < PPT; ++q)
#pragma unroll
        for (int j = 0; j < 4; ++j) z[c][q][j] = 0;
    const int n = lane() / 4;
    const float* b_row = panel + (quad ? n % 2 * 4 + n / 2 : n) * ld + lane() % 4;
#pragma unroll 1
    for (int k = 0; k < H; k += kSteps * kBlockK) {
      float a[kSteps][2][4], a_low[kSteps][2][4];
#pragma unroll
      for (int h = 0; h < kSteps; ++h) {
        const float* w = weights.next();
#pragma unroll
        for (int m = 0; m < 2; ++m) {
          const float4 v = *reinterpret_cast<const float4*>(w + m * 128);
          const float raw[4] = {v.x, v.y, v.z, v.w};
#pragma unroll
          for (int i = 0; i < 4; ++i) {
            a[h][m][i] = Forward ? to_tf32(raw[i]) : raw[i];
            a_low[h][m][i] = to_tf32(raw[i] - a[h][m][i]);
          }
        }
      }
      // tiles in groups: their products are independent and hide each other's latency
#pragma unroll
      for (int first = 0; first < tiles; first += kTogether)
        multiply_group<Forward>(b_row + first * 8 * ld + k, first, a, a_low, z);
    }
  }

 private:
  static constexpr int kTogether = 4;  // tiles of a group
  static constexpr int kSteps = 2;     // stages whose sums the tensor cores add up

  template <bool Forward>
  static __device__ void multiply_group(const float* from, int first,
                                        const float (&a)[kSteps][2][4],
                                        const float (&a_low)[kSteps][2][4], Values& z) {
    float b[kTogether][kSteps][2], b_low[kTogether][kSteps][2], s[kTogether][2][4] = {};
#pragma unroll
    for (int i = 0; i < kTogether; ++i)
#pragma unroll
      for (int h = 0; h < kSteps; ++h)
#pragma unroll
        for (int half = 0; half < 2; ++half) {
          if (first + i >= tiles) continue;
          const float* at = from + i * 8 * ld + h * kBlockK + 4 * half;
          b[i][h][half] = at[0];
          b_low[i][h][half] = Forward ? at[R * ld] : 0;
        }
    if (!Forward) values_of(first, s, z);
#pragma unroll
    for (int h = 0; h < kSteps; ++h)
#pragma unroll
      for (int part = Forward ? 0 : 2; part < 3; ++part)
#pragma unroll
        for (int i = 0; i < kTogether; ++i)
#pragma unroll
          for (int m = 0; m < 2; ++m)
            if (first + i < tiles)
              mma_tf32(s[i][m], part == 0 ? a_low[h][m] : a[h][m],
                       part == 1 ? b_low[i][h] : b[i][h]);
    if (Forward) {
      float sum[kTogether][2][4] = {};
      values_of(first, sum, z);
#pragma unroll
      for (int i = 0; i < kTogether * 8; ++i)
        s[i / 8][i / 4 % 2][i % 4] += sum[i / 8][i / 4 % 2][i % 4];
    }
    set_values(first, s, z);
  }

  // The place of element d of tensor-core tile (t, m) in a thread's values: its two columns are two
  // channels of a point, or two points.
  static __device__ float& value_of(Values& z, int t, int m, int d) {
    const int c = quad ? 2 * t + d % 2 : t / (quad ? 1 : PT / 8),
              q = quad ? 0 : t % (quad ? 1 : PT / 8) * 2 + d % 2;
    return z[c][q][2 * m + d / 2];
  }
  static __device__ void values_of(int first, float (&s)[kTogether][2][4], Values& z) {
#pragma unroll
    for (int i = 0; i < kTogether * 8; ++i)
      if (first + i / 8 < tiles)
        s[i / 8][i / 4 % 2][i % 4] = value_of(z, first + i / 8, i / 4 % 2, i % 4);
  }
  static __device__ void set_values(int first, const float (&s)[kTogether][2][4], Values& z) {
#pragma unroll
    for (int i = 0; i < kTogether * 8; ++i)
      if (first + i / 8 < tiles)
        value_of(z, first + i / 8, i / 4 % 2, i % 4) = s[i / 8][i / 4 % 2][i % 4];
  }
};

}  // namespace granpinn::cuda::fused
