// Products of a tile on tensor cores, as float32-grade forward and TF32 backward products.
//
// z^T = W a^T with mma.m16n8k8: neurons are the rows of the tensor cores' tile, so a weight fragment
// is used by one warp alone and comes straight from the stream, and a thread ends up with all
// channels of its points. Forward: each operand is split into two TF32 numbers, of the four products
// the smallest is left out, and the tensor cores' sums over eight terms are added in float32
// registers: added up inside, they would be truncated. Backward products are TF32, rounded to nearest.
#pragma once

#include "weight_stream.cuh"

namespace granpinn::cuda::fused {

__device__ inline float to_tf32(float a) {
  std::uint32_t out;
  asm("cvt.rna.tf32.f32 %0, %1;" : "=r"(out) : "f"(a));
  return __uint_as_float(out);
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
  static constexpr int kTogether = 4;  // tiles whose products are interleaved
  static constexpr int ld = H + 4;
  static constexpr bool tensor_cores = true;
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
  static __device__ float operand(float a) { return to_tf32(a); }

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
    for (int k = 0; k < H; k += kBlockK) {
      const float* w = weights.next() + 4 * lane();
      float a[2][4], a_low[2][4];
#pragma unroll
      for (int m = 0; m < 2; ++m) {
        const float4 v = *reinterpret_cast<const float4*>(w + m * 128);
        const float raw[4] = {v.x, v.y, v.z, v.w};
#pragma unroll
        for (int i = 0; i < 4; ++i) {
          a[m][i] = Forward ? to_tf32(raw[i]) : raw[i];
          a_low[m][i] = raw[i] - a[m][i];
        }
      }
      // tiles in groups: their products are independent and hide each other's latency
#pragma unroll
      for (int first = 0; first < tiles; first += kTogether) {
        float b[kTogether][2], b_low[kTogether][2], s[kTogether][2][4] = {};
#pragma unroll
        for (int i = 0; i < kTogether; ++i)
#pragma unroll
          for (int h = 0; h < 2; ++h) {
            if (first + i >= tiles) continue;
            const float raw = b_row[(first + i) * 8 * ld + k + 4 * h];
            b[i][h] = Forward ? to_tf32(raw) : raw;
            b_low[i][h] = raw - b[i][h];
          }
#pragma unroll
        for (int part = Forward ? 0 : 2; part < 3; ++part)
#pragma unroll
          for (int i = 0; i < kTogether; ++i)
#pragma unroll
            for (int m = 0; m < 2; ++m)
              if (first + i < tiles)
                mma_tf32(s[i][m], part == 0 ? a_low[m] : a[m], part == 1 ? b_low[i] : b[i]);
#pragma unroll
        for (int i = 0; i < kTogether; ++i)
#pragma unroll
          for (int m = 0; m < 2; ++m)
#pragma unroll
            for (int h = 0; h < 2; ++h) {
              if (first + i >= tiles) continue;
              // the two columns of a thread: channels 2 t, 2 t + 1 of a point, or two points
              const int t = first + i;
              const int c0 = quad ? 2 * t : t / (PT / 8), c1 = quad ? 2 * t + 1 : c0;
              const int q0 = quad ? 0 : t % (PT / 8) * 2, q1 = quad ? 0 : q0 + 1;
              z[c0][q0][2 * m + h] += s[i][m][2 * h];
              z[c1][q1][2 * m + h] += s[i][m][2 * h + 1];
            }
      }
    }
  }
};

}  // namespace granpinn::cuda::fused
