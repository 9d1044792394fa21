// Symmetric products of newton_schulz_half.cu: Y Y^T for A = X X^T and for A^2.
//
// Rows and columns are four bands of 32. Warp w = 0 .. 3 is `near` the diagonal and computes Nw;
// warp 4 + w computes Fw. Every other tile is a transposed copy that the same warp stores.
//
//             band 0    band 1    band 2    band 3
//   band 0    N0        F0        N0 | N2             N0 | N2: left half by warp 0, right half by
//   band 1              N1        F1        N1 | N3             warp 2
//   band 2                        N2        F2
//   band 3    F3                            N3
//
//   name      shape              where      layout
//   tile      32 x 32 float      registers  [2][4][4] of a lane: tiles of m16n8k16
//   opposite  32 x 16 float      registers  [2][2][4] of a lane, near warps alone
//   Terms     16 columns of Y    registers  fragments of 16 x 16 halves
//   Y         128 x 128 halves   shared     a square of half_square.cuh
#pragma once

#include "half_square.cuh"

namespace granpinn::cuda::half_square {

// The tiles of one warp. Near: the tile on the diagonal, and half of the opposite one.
struct Band {
  int band, lane;
  Sum tile[2][4], opposite[2][2];

  struct Terms {
    Fragment own[2], next[2], upper[2], lower[1];
  };

  // Adds Y Y^T, over 16 `steps` columns of Y.
  template <bool Near>
  __device__ void add_product(unsigned Y, int steps) {
    Terms even, odd;
    load<Near>(even, Y, 0);
#pragma unroll 1
    for (int k = 0; k < steps; k += 2) {
      load<Near>(odd, Y, k + 1);
      add<Near>(even);
      load<Near>(even, Y, k + 2);
      add<Near>(odd);
    }
  }

  template <class F>
  __device__ void each(F f) {
    each_of(tile, f);
    each_of(opposite, f);
  }
  template <bool Near>
  __device__ void store(unsigned to) const {
    if (Near) {
      store_tile<2, 4, false>(to, 2 * band, 4 * band, lane, tile);
      store_tile<2, 2, true>(to, band % 2 * 2, lower() * 2, lane, opposite);
    } else {
      store_tile<2, 4, true>(to, 2 * band, (band + 1) % 4 * 4, lane, tile);
    }
  }

 private:
  // first column of the opposite half, in units of 16
  __device__ int lower() const { return band < 2 ? 2 * band + 4 : 2 * band + 1; }

  template <bool Near>
  __device__ void load(Terms& t, unsigned Y, int k) const {
    const unsigned left = (Y + left_lane(lane)) ^ (k % 8 * 32);
    const unsigned right = (Y + right_lane(lane)) ^ (k % 8 * 32);
    constexpr unsigned rows = 16 * kRowBytes;
#pragma unroll
    for (int i = 0; i < 2; ++i) {
      t.own[i] = half_square::load(left + (2 * band + i) * rows);
      if (!Near) t.next[i] = half_square::load(right + ((2 * band + 2) % 8 + i) * rows);
      if (Near) t.upper[i] = half_square::load(left + (band % 2 * 2 + i) * rows);
    }
    if (Near) t.lower[0] = half_square::load(right + lower() * rows);
  }
  template <bool Near>
  __device__ void add(const Terms& t) {
    if (Near) {
      const Fragment right[] = {right_of(t.own[0]), right_of(t.own[1])};
      multiply_add<2, 2>(tile, t.own, right);
      multiply_add<2, 1>(opposite, t.upper, t.lower);
    } else {
      multiply_add<2, 2>(tile, t.own, t.next);
    }
  }
  template <int M, int N, class F>
  static __device__ void each_of(Sum (&d)[M][N], F f) {
#pragma unroll
    for (int v = 0; v < 4 * M * N; ++v) {
      float& value = d[v / (4 * N)][v / 4 % N][v % 4];
      value = f(value);
    }
  }
};

}  // namespace granpinn::cuda::half_square
