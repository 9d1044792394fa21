// Symmetric products of newton_schulz_half.cu: A = X X^T and P = b A + c A^2.
//
// Their rows are four bands of 32, and nothing is made twice: a band has its tile on the diagonal,
// the next one to the right (that of the last band is in the first), and half of the opposite one.
// The others are mirrored.
#pragma once

#include "half_square.cuh"

namespace granpinn::cuda::half_square {

// What one of the two warps of a band makes: the one near the diagonal the tile there and the
// opposite half, the other one the next tile.
struct Band {
  int band, lane;
  Sum tile[2][4], opposite[2][2];

  struct Terms {
    Fragment own[2], next[2], upper[2], lower[1];
  };

  // += Y Y^T, `steps` times 16 columns of it
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
  // of bands 0 and 2, and 1 and 3, the first has the left half of their tile
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
