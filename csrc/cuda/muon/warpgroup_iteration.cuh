// The iteration of newton_schulz_half.cu by two warpgroups (wgmma), for compute capability 9.0.
//
//   X and the sums in registers, 128 x 128
//           +-----------------------------+
//     64    | warpgroup 0                 |   each warp 16 x 128: Sums of warpgroup_square.cuh
//           +-----------------------------+
//     64    | warpgroup 1                 |
//           +-----------------------------+
#pragma once

#include "warpgroup_square.cuh"

namespace granpinn::cuda::warpgroup {

class WarpgroupIteration {
 public:
  __device__ float* pair(int v) { return X_[v / 2] + v % 2 * 2; }
  __device__ int row(int v) const { return row_ + v % 2 * 8 + threadIdx.x % 32 / 4; }
  __device__ int column(int v) const { return v / 2 * 8 + threadIdx.x % 4 * 2; }

  __device__ void store(unsigned square) const { warpgroup::store(square, row_, X_); }
  static __device__ void publish() { warpgroup::publish(); }

  // Squares are padded with zeros, and all of their numbers are used.
  __device__ void advance(unsigned A, unsigned P, unsigned X, int, int) {
    Sums sums = {};
    add_product<false>(sums, X, top_, X);
    warpgroup::store(A, row_, sums);
    publish();
    scale(sums, kB / kC);
    add_product<false>(sums, A, top_, A);  // A is its own transpose
    scale(sums, kC);
    warpgroup::store(P, row_, sums);
    publish();
    scale(X_, kA);
    add_product<true>(X_, P, top_, X);
  }

 private:
  static __device__ void scale(Sums& d, float factor) {
#pragma unroll
    for (int v = 0; v < 64; ++v) d[v / 4][v % 4] *= factor;
  }

  const int top_ = threadIdx.x / 128 * 64, row_ = threadIdx.x / 32 * 16;  // of warpgroup, of warp
  Sums X_;
};

}  // namespace granpinn::cuda::warpgroup
