// Products of a tile on tensor cores: float32-grade, or, on the strong form's way back, with
// mantissas of ten bits (of the value channel, twenty).
//
// z^T = W a^T with mma.m16n8k16 on halves: neurons are the rows of the tensor cores' tile, so a
// weight fragment is used by one warp alone and comes straight from its stream, and a thread ends
// up with all channels of its points. Float32-grade, each operand is split into two halves of 11
// bits each; of the four products the smallest is left out, and the tensor cores' sums over 16
// terms are added in float32 registers: added up inside, they would be truncated. Halves have the
// mantissa of TF32 at twice its rate but a short range, hence scales, all powers of two: each
// channel of a tile is scaled by its largest value, weights by 2^8 (beyond +-255 a weight makes the
// loss infinite).
#pragma once

#include <cuda_fp16.h>

#include "lanes.cuh"

namespace granpinn::cuda::fused {

constexpr int kWeightExponent = 8;
constexpr int kNoScale = 1 << 20;  // of zeros

// Tensor cores cut off what they cannot keep of a sum. That takes a third of the last place from
// those of a block of inputs on average (measured on an H200), alike in all points, so that it does
// not average out. These factors give it back: of each sum, and of what they add up to. (The strong
// form, whose error in float32 is larger, does without.)
constexpr float kBlockFactor = 1.2421875f, kSumFactor = 0x1.9c2d16p-1f;
constexpr double kGivenBack = (double{kBlockFactor} * double{kSumFactor} - 1) * (1 << 23);
static_assert(0.33 < kGivenBack && kGivenBack < 0.34, "a third of the last place");

// Two numbers as halves, the first in the lower bits, and what rounding took away.
__device__ inline unsigned to_halves(float a, float b) {
  const __half2 h = __floats2half2_rn(a, b);
  return *reinterpret_cast<const unsigned*>(&h);
}
__device__ inline unsigned rest_of_halves(unsigned halves, float a, float b) {
  const float2 f = __half22float2(*reinterpret_cast<const __half2*>(&halves));
  return to_halves(a - f.x, b - f.y);
}

// d = a b + c
__device__ inline void mma_f16(float (&d)[4], uint4 a, unsigned b0, unsigned b1,
                               const float (&c)[4]) {
  asm("mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 {%0,%1,%2,%3}, {%4,%5,%6,%7}, {%8,%9}, "
      "{%10,%11,%12,%13};"
      : "=f"(d[0]), "=f"(d[1]), "=f"(d[2]), "=f"(d[3])
      : "r"(a.x), "r"(a.y), "r"(a.z), "r"(a.w), "r"(b0), "r"(b1), "f"(c[0]), "f"(c[1]), "f"(c[2]),
        "f"(c[3]));
}

// Largest absolute value, as bits of a float -> the exponent of the power of two that brings it to
// [2^14, 2^15); 0 for zeros. Both powers of two are normal numbers.
__device__ inline int scale_exponent(unsigned peak) {
  const int exponent = static_cast<int>(peak >> 23);
  return exponent == 0 ? 0 : 141 - max(exponent, 40);
}
__device__ inline float power_of_two(int exponent) {
  return __uint_as_float(static_cast<unsigned>(127 + exponent) << 23);
}

// Points: 4, or a multiple of 8.
template <int Width, int Channels, int Points, int Split, int Stages, bool FineWeights,
          bool MoreRows>
struct MmaEngine : Lanes<Width, Split> {
  using L = Lanes<Width, Split>;
  using L::H, L::neurons;
  static constexpr int C = Channels;
  static constexpr int PT = Points;
  static constexpr bool quad = PT == 4;  // a tensor-core tile then holds two channels of 4 points
  static constexpr int CP = quad ? (C + 1) / 2 * 2 : C;
  static constexpr int PPT = quad ? 1 : PT / 4;
  static constexpr int R = CP * PT;
  static constexpr int tiles = R / 8;
  static constexpr int ld = row_floats(H);  // rows eight banks apart
  static constexpr int exchange = Split == 1 ? 2 : CP * PPT * L::threads;
  // in the panels, of the value channel's second pieces: compensated() and fine_weights(), layout.h
  static constexpr bool more_rows = MoreRows;
  using Stream = WeightStream<512, Stages>;
  using Values = float[CP * PPT][neurons];
  using Element = __half;  // of the panels
  using Stored = unsigned[neurons / 2];
  template <bool Forward>
  static constexpr bool fine = Forward || FineWeights;  // operands in two pieces, weights too

  static __device__ int point(int q) {
    return quad ? L::point_lane() : q / 2 * 8 + L::point_lane() * 2 + q % 2;
  }
  static __device__ int row(int c, int q) { return c * PT + point(q); }

  // Raises the channels' largest absolute values to those of this warp; lane c has channel c.
  static __device__ void note_peaks(const Values& a, unsigned* peaks) {
    unsigned own = 0;
#pragma unroll
    for (int c = 0; c < C; ++c) {
      float peak = 0;
#pragma unroll
      for (int i = 0; i < PPT * neurons; ++i)
        peak = fmaxf(peak, fabsf(a[c * PPT + i / neurons][i % neurons]));
      const unsigned warp_peak = __reduce_max_sync(~0u, __float_as_uint(peak));
      if (L::lane() == c) own = warp_peak;
    }
    if (L::lane() < C) atomicMax(peaks + L::lane(), own);
  }
  static __device__ void remove_scales(Values& z, const unsigned* peaks) {
#pragma unroll
    for (int c = 0; c < C; ++c) {
      float factor = power_of_two(-scale_exponent(peaks[c]) - kWeightExponent);
      if constexpr (FineWeights) factor *= kSumFactor;
#pragma unroll
      for (int i = 0; i < PPT * neurons; ++i) z[c * PPT + i / neurons][i % neurons] *= factor;
    }
  }

  // The weights kernel gets the exponents of the scales, one for each four of a tile's rows: these
  // are of the same channel. Behind the channels are rows of the value channel, or none.
  static __device__ void store_scales(int* to, int panel_rows, const unsigned* peaks) {
#pragma unroll 1
    for (int i = threadIdx.x; i < panel_rows / 4; i += L::threads) {
      const int c = 4 * i < R ? 4 * i / PT : 0;
      const unsigned peak = c < C ? peaks[c] : 0;
      to[i] = peak >> 23 == 0 ? kNoScale : scale_exponent(peak);
    }
  }

  // Of channel c of the operands; a channel of padding has none.
  static __device__ float scale_of(int c, const unsigned* peaks) {
    return c < C ? power_of_two(scale_exponent(peaks[c])) : 1;
  }

  // A thread's neurons of channel c of its point q into the panel, as operands of the next product;
  // `stored` is what the weights kernel gets, `rest` what is left then. With two pieces, a row
  // holds for every four inputs these inputs and then what rounding took from them; with weights in
  // one piece, that of the value channel's rows is behind all inputs.
  template <bool Forward>
  static __device__ void put(float* panel, int c, int q, float scale, const float (&v)[neurons],
                             Stored& stored, [[maybe_unused]] Stored& rest) {
    constexpr bool two_pieces = fine<Forward>;
    unsigned halves[neurons];
#pragma unroll
    for (int j = 0; j < neurons; j += 2) {
      const float a = v[j] * scale, b = v[j + 1] * scale;
      halves[j] = to_halves(a, b);
      const bool rests = two_pieces || (MoreRows && of_values(c));
      halves[j + 1] = rests ? rest_of_halves(halves[j], a, b) : 0;
    }
    unsigned* to = reinterpret_cast<unsigned*>(panel + panel_row(c, q) * ld);
    const int four = L::column() / 4;
    if constexpr (two_pieces && neurons == 4) {
      reinterpret_cast<uint4*>(to)[four] = make_uint4(halves[0], halves[2], halves[1], halves[3]);
    } else if constexpr (two_pieces) {
      to[4 * four + L::part()] = halves[0];
      to[4 * four + 2 + L::part()] = halves[1];
    } else if constexpr (neurons == 4) {
      reinterpret_cast<uint2*>(to)[four] = make_uint2(halves[0], halves[2]);
      if (MoreRows && of_values(c))
        reinterpret_cast<uint2*>(to)[H / 4 + four] = make_uint2(halves[1], halves[3]);
    } else {
      to[2 * four + L::part()] = halves[0];
      if (MoreRows && of_values(c)) to[H / 2 + 2 * four + L::part()] = halves[1];
    }
#pragma unroll
    for (int j = 0; j < neurons / 2; ++j) {
      stored[j] = halves[2 * j];
      if constexpr (MoreRows) rest[j] = halves[2 * j + 1];
    }
  }
  static __device__ void store(__half* row, const Stored& v) {
    if constexpr (neurons == 4)
      *reinterpret_cast<uint2*>(row + L::column()) = make_uint2(v[0], v[1]);
    else
      *reinterpret_cast<unsigned*>(row + L::column()) = v[0];
  }

  // z[row][neuron] = sum_k panel[row][k] W[k][neuron], times the scales
  template <bool Forward>
  static __device__ void multiply(const float* panel, Stream& weights, float2* memory, Values& z) {
    float sum[CP * PPT][4];
#pragma unroll
    for (int i = 0; i < CP * PPT * 4; ++i) sum[i / 4][i % 4] = 0;
    // this lane's sixteen bytes of the row of its tensor-core column
    const float* from = panel + place(L::lane() / 4) * ld + L::lane() % 4 * 4;
    constexpr int block = fine<Forward> ? 16 : 32;  // inputs of a stage
    from += L::part() * (H / Split / block) * 16;
#pragma unroll 1
    for (int k = 0; k < H / Split; k += block, from += 16) {
      const float* w = weights.next();
      uint4 a[4];
#pragma unroll
      for (int i = 0; i < 4; ++i) a[i] = *reinterpret_cast<const uint4*>(w + i * 128);
      // tiles in groups: their products are independent and hide each other's latency
#pragma unroll
      for (int first = 0; first < tiles; first += together)
        multiply_group<Forward>(from + first * 8 * ld, first, a, sum);
    }
    L::exchange(memory, sum, z);
  }

 private:
  // Where the panel holds the row of column n of a tensor-core tile: so that eight lanes reach all
  // banks, both when they read rows n, n + 1 and when they write rows 0, 2, 4, 6.
  static __device__ int place(int n) { return n % 2 ? 4 + (n / 2 + 2) % 4 : n / 2; }
  static __device__ int panel_row(int c, int q) {
    if (quad) return c / 2 * 8 + place(point(q) * 2 + c % 2);
    return row(c, q) / 8 * 8 + place(row(c, q) % 8);
  }

  static constexpr int together = tiles <= 4 ? tiles : 2;

  // Whether channel c shares tensor-core tiles with the value channel; whether tile t has it.
  static __device__ constexpr bool of_values(int c) { return quad ? c < 2 : c == 0; }
  static constexpr bool has_values(int t) { return quad ? t == 0 : t < PT / 8; }

  // Whether second pieces of the inputs are taken too: not of the derivatives' adjoints in large
  // tiles. Their rounding differs from point to point and, unlike the weights', averages out.
  template <bool Forward>
  static constexpr bool fine_inputs(int t) {
    return Forward || PT < 16 || has_values(t);
  }

  // Products of tensor-core tiles with a stage. Of weights in two pieces: low high + high low +
  // high high, then added to the sum in a register. Of one piece: those of its two halves of the
  // inputs, added up by the tensor core.
  template <bool Forward>
  static __device__ void multiply_group(const float* from, int first, const uint4 (&a)[4],
                                        float (&sum)[CP * PPT][4]) {
    uint4 b[together];
    float d[together][2][4];
#pragma unroll
    for (int i = 0; i < together; ++i)
      if (first + i < tiles) b[i] = *reinterpret_cast<const uint4*>(from + i * 8 * ld);
#pragma unroll
    for (int j = 0; j < together * 8; ++j) {
      const int t = first + j / 8;
      d[j / 8][j / 4 % 2][j % 4] =
          t < tiles && !fine<Forward> ? value_of(sum, t, j / 4 % 2, j % 4) : 0;
    }
    constexpr int parts = fine<Forward> ? 3 : 2;
    constexpr int second = fine<Forward> ? 0 : 1;  // part that takes the later weights
#pragma unroll
    for (int part = 0; part < parts; ++part)
#pragma unroll
      for (int i = 0; i < together; ++i)
#pragma unroll
        for (int m = 0; m < 2; ++m) {
          if (first + i >= tiles) continue;
          if (FineWeights && part == 1 && !fine_inputs<Forward>(first + i)) continue;
          const uint4& v = b[i];
          mma_f16(d[i][m], a[part == second ? 2 + m : m], part == 1 ? v.z : v.x,
                  part == 1 ? v.w : v.y, d[i][m]);
        }
    if constexpr (!Forward && !FineWeights && MoreRows) {  // and those of the second pieces
#pragma unroll
      for (int i = 0; i < together; ++i) {
        if (!has_values(first + i)) continue;
        const uint4 v = *reinterpret_cast<const uint4*>(from + i * 8 * ld + H / 2);
#pragma unroll
        for (int m = 0; m < 4; ++m)
          mma_f16(d[i][m % 2], a[m], m < 2 ? v.x : v.z, m < 2 ? v.y : v.w, d[i][m % 2]);
      }
    }
#pragma unroll
    for (int j = 0; j < together * 8; ++j) {
      const int t = first + j / 8;
      if (t >= tiles) continue;
      float& s = value_of(sum, t, j / 4 % 2, j % 4);
      const float product = d[j / 8][j / 4 % 2][j % 4];
      if constexpr (FineWeights)  // both ways
        s = fmaf(product, kBlockFactor, s);
      else
        s = fine<Forward> ? s + product : product;
    }
  }

  // The place of element d of tensor-core tile (t, m) among a thread's values: its two columns are
  // two channels of a point, or two points.
  static __device__ float& value_of(float (&z)[CP * PPT][4], int t, int m, int d) {
    const int i =
        quad ? 2 * t + d % 2 : t / (quad ? 1 : PT / 8) * PPT + t % (quad ? 1 : PT / 8) * 2 + d % 2;
    return z[i][2 * m + d / 2];
  }
};

}  // namespace granpinn::cuda::fused
