// Products of a tile on tensor cores, with mma.m16n8k16 on halves (halves.cuh).
//
//   z[row][n] = sum_k a[row][k] W[k][n],   row = (channel, point);  k, n: neurons
//
// The tensor core computes the transposed product z^T = W^T a^T. A warp computes the 32 neurons n
// of its slab for all rows of the tile:
//
//                   16 inputs k          8 rows   8 rows
//                                       +-------+-------+-- ... --+
//                                     k | b[0]  | b[1]  |         |   R / 8 tensor-core tiles
//                 +-----------+         +-------+-------+-- ... --+
//    16 neurons   | a, m = 0  |         | d[0]  | d[1]  |         |   d[i][m]: float32
//                 +-----------+         +-------+-------+-- ... --+
//    16 neurons   | a, m = 1  |         |       |       |         |
//                 +-----------+         +-------+-------+-- ... --+
//
// A weight fragment belongs to one warp, so it comes straight from the warp's stream. A thread ends
// up with four consecutive neurons of its points, in all channels, because of the order of
//
//   neurons   row g of tile m is neuron 4 (g % 8) + 2 m + g / 8 of the slab
//   rows      quad:  column n of tile t is point n / 2 of channel 2 t + n % 2
//             else:  column n of tile t is point 8 (t % (PT / 8)) + n of channel t / (PT / 8)
//   inputs    lane l loads 4 (two pieces) or 8 (one piece) consecutive inputs, from
//             4 (l % 4) or 8 (l % 4) of the block on
//
//   name     shape                     where      layout
//   panel    R rows x H                shared     two pieces: [row][H / 4][4 high, 4 low] halves
//                                                 one piece:  [row][H high, then H low of the value
//                                                 channel]
//   weights  32 x 16, two pieces       shared     stage [piece][m][lane][8]
//            32 x 32, one piece        shared     stage [inputs 0-3, 4-7 of a lane][m][lane][8]
//   a, b     a stage, its inputs       registers  uint4 of 8 halves for a lane
//   d        together x 2 x 4          registers  one stage; `together` independent products
//   sum, z   CP PPT x 4, x neurons     registers  [channel][point of the thread][neuron]
//   memory   CP PPT x threads          shared     for Lanes::exchange, if Split = 2
//
// Precision of a product:
//
//   forward, and backward if FineWeights   low high + high low + high high, each block of 16 inputs
//                                          added in float32 registers: float32-grade
//   backward, else                         high high, added up by the tensor core: ten bits of
//                                          mantissa; if MoreRows, high low in the value channel too
#pragma once

#include "halves.cuh"
#include "lanes.cuh"

namespace granpinn::cuda::fused {

// Points: 4, or a multiple of 8. Split: warps of a slab. Stages: of a warp's ring. Kept: layout.h.
template <int Width, int Channels, int Points, int Split, int Stages, bool FineWeights,
          bool MoreRows, bool Kept>
struct MmaEngine : Lanes<Width, Split> {
  using L = Lanes<Width, Split>;
  using L::H, L::neurons;
  static constexpr int C = Channels;
  static constexpr int PT = Points;
  static constexpr bool quad = PT == 4;  // a tensor-core tile holds two channels of 4 points
  static constexpr int CP = quad ? (C + 1) / 2 * 2 : C;
  static constexpr int PPT = quad ? 1 : PT / 4;
  static constexpr int R = CP * PT;
  static constexpr int tiles = R / 8;
  static constexpr int ld = row_floats(H);  // rows eight banks apart
  static constexpr int exchange = Split == 1 ? 2 : CP * PPT * L::threads;
  // Whether the panels hold low pieces of the value channel, too: compensated() in layout.h.
  static constexpr bool more_rows = MoreRows;
  using Stream = WeightStream<512, Stages>;
  using Values = float[CP * PPT][neurons];
  using Element = __half;  // of the panels in global memory
  using Stored = unsigned[neurons / 2];
  template <bool Forward>
  static constexpr bool fine = Forward || FineWeights;  // weights and operands in two pieces

  static __device__ int point(int q) {
    return quad ? L::point_lane() : q / 2 * 8 + L::point_lane() * 2 + q % 2;
  }
  static __device__ int row(int c, int q) { return c * PT + point(q); }

  // Raises peaks[c] to the largest absolute value of channel c in this warp.
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

  // Writes the exponents of the scales for the weights kernel: one for every four rows, which are
  // of the same channel. The rows from R on are of the value channel, or zero.
  static __device__ void store_scales(int* to, int panel_rows, const unsigned* peaks) {
#pragma unroll 1
    for (int i = threadIdx.x; i < panel_rows / 4; i += L::threads) {
      const int c = 4 * i < R ? 4 * i / PT : 0;
      const unsigned peak = c < C ? peaks[c] : 0;
      to[i] = peak >> 23 == 0 ? kNoScale : scale_exponent(peak);
    }
  }

  // Scale of channel c of the operands; 1 for a channel of padding.
  static __device__ float scale_of(int c, const unsigned* peaks) {
    return c < C ? power_of_two(scale_exponent(peaks[c])) : 1;
  }

  // Writes the neurons of channel c of this thread's point q to the panel, as operands of the next
  // product. `stored` and `rest` are the high and low pieces for the weights kernel.
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
  template <class T>
  static __device__ void write(T* to, T value) {
    if constexpr (Kept)
      *to = value;
    else
      __stcs(to, value);
  }
  static __device__ void store(__half* row, const Stored& v) {
    if constexpr (neurons == 4)
      write(reinterpret_cast<uint2*>(row + L::column()), make_uint2(v[0], v[1]));
    else
      write(reinterpret_cast<unsigned*>(row + L::column()), v[0]);
  }

  // z as above, times the scales of operands and weights.
  template <bool Forward>
  static __device__ void multiply(const float* panel, Stream& weights, float2* memory, Values& z) {
    float sum[CP * PPT][4];
#pragma unroll
    for (int i = 0; i < CP * PPT * 4; ++i) sum[i / 4][i % 4] = 0;
    // address of this lane's 16 bytes in the row of its tensor-core column
    const float* from = panel + place(L::lane() / 4) * ld + L::lane() % 4 * 4;
    constexpr int block = fine<Forward> ? 16 : 32;  // inputs of a stage
    from += L::part() * (H / Split / block) * 16;
#pragma unroll 1
    for (int k = 0; k < H / Split; k += block, from += 16) {
      const float* w = weights.next();
      uint4 a[4];
#pragma unroll
      for (int i = 0; i < 4; ++i) a[i] = *reinterpret_cast<const uint4*>(w + i * 128);
      // the products of a group of tiles are independent and hide each other's latency
#pragma unroll
      for (int first = 0; first < tiles; first += together)
        multiply_group<Forward>(from + first * 8 * ld, first, a, sum);
    }
    L::exchange(memory, sum, z);
  }

 private:
  // Position in the panel of column n of a tensor-core tile. With this order eight lanes reach all
  // banks, both when they read columns n, n + 1 and when they write columns 0, 2, 4, 6.
  static __device__ int place(int n) { return n % 2 ? 4 + (n / 2 + 2) % 4 : n / 2; }
  static __device__ int panel_row(int c, int q) {
    if (quad) return c / 2 * 8 + place(point(q) * 2 + c % 2);
    return row(c, q) / 8 * 8 + place(row(c, q) % 8);
  }

  static constexpr int together = tiles <= 4 ? tiles : 2;

  // Whether channel c is in the tensor-core tiles of the value channel; whether tile t is one.
  static __device__ constexpr bool of_values(int c) { return quad ? c < 2 : c == 0; }
  static constexpr bool has_values(int t) { return quad ? t == 0 : t < PT / 8; }

  // Whether the low pieces of tile t's inputs are used. Large tiles leave out those of the adjoints
  // of derivatives: their rounding differs from point to point, so it averages out. That of the
  // weights does not.
  template <bool Forward>
  static constexpr bool fine_inputs(int t) {
    return Forward || PT < 16 || has_values(t);
  }

  // Products of `together` tensor-core tiles with a stage. The weights' piece is named first:
  // two pieces: parts low high, high low, high high, added to `sum` in registers;
  // one piece:  parts inputs 0-3 and inputs 4-7 of a lane, added to `sum` by the tensor core.
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
    constexpr int second = fine<Forward> ? 0 : 1;  // part that uses a[2], a[3]
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
    if constexpr (!Forward && !FineWeights && MoreRows) {  // low pieces of the value channel
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
      if constexpr (FineWeights)  // forward and backward
        s = fmaf(product, kBlockFactor, s);
      else
        s = fine<Forward> ? s + product : product;
    }
  }

  // Element d of tensor-core tile (t, m) among a thread's values. The thread's two columns are two
  // channels of a point (quad), or two points.
  static __device__ float& value_of(float (&z)[CP * PPT][4], int t, int m, int d) {
    const int i =
        quad ? 2 * t + d % 2 : t / (quad ? 1 : PT / 8) * PPT + t % (quad ? 1 : PT / 8) * 2 + d % 2;
    return z[i][2 * m + d / 2];
  }
};

}  // namespace granpinn::cuda::fused
