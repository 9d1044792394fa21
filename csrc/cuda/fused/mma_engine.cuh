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

__device__ inline void mma_tf32(float& d0, float& d1, float& d2, float& d3, const float (&a)[4],
                                const float (&b)[2]) {
  asm("mma.sync.aligned.m16n8k8.row.col.f32.tf32.tf32.f32 {%0,%1,%2,%3}, {%4,%5,%6,%7}, {%8,%9}, "
      "{%0,%1,%2,%3};"
      : "+f"(d0), "+f"(d1), "+f"(d2), "+f"(d3)
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
  using Stream = WeightStream<H, 4>;
  using Values = float[CP][PPT][4];

  static __device__ int lane() { return threadIdx.x % 32; }
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
#pragma unroll
      for (int t = 0; t < tiles; ++t) {
        const float raw[2] = {b_row[t * 8 * ld + k], b_row[t * 8 * ld + k + 4]};
        float b[2], b_low[2];
#pragma unroll
        for (int i = 0; i < 2; ++i) {
          b[i] = Forward ? to_tf32(raw[i]) : raw[i];
          b_low[i] = raw[i] - b[i];
        }
        // the two columns of a thread: channels 2 t, 2 t + 1 of a point, or two points
        const int c0 = quad ? 2 * t : t / (PT / 8), c1 = quad ? 2 * t + 1 : c0;
        const int q0 = quad ? 0 : t % (PT / 8) * 2, q1 = quad ? 0 : q0 + 1;
#pragma unroll
        for (int m = 0; m < 2; ++m) {
          float &d0 = z[c0][q0][2 * m], &d1 = z[c1][q1][2 * m];
          float &d2 = z[c0][q0][2 * m + 1], &d3 = z[c1][q1][2 * m + 1];
          if (Forward) {
            float s[4] = {0, 0, 0, 0};
            mma_tf32(s[0], s[1], s[2], s[3], a_low[m], b);
            mma_tf32(s[0], s[1], s[2], s[3], a[m], b_low);
            mma_tf32(s[0], s[1], s[2], s[3], a[m], b);
            d0 += s[0], d1 += s[1], d2 += s[2], d3 += s[3];
          } else {
            mma_tf32(d0, d1, d2, d3, a[m], b);
          }
        }
      }
    }
  }
};

}  // namespace granpinn::cuda::fused
