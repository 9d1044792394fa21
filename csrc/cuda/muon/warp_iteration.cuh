// The iteration of newton_schulz_half.cu by warps (mma.sync), for any GPU with tensor cores.
//
//   X in registers, 128 x 128               A and P: half_polynomial.cuh
//           +--------------+--------------+
//     32    | warp 0       | warp 1       |
//           +--------------+--------------+
//     32    | warp 2       | warp 3       |   each warp 32 x 64: 2 x 8 tiles of m16n8k16
//           +--------------+--------------+
//            ...              64 columns
#pragma once

#include <type_traits>

#include "half_polynomial.cuh"

namespace granpinn::cuda::half_square {

// A <- X X^T, then P <- c (b/c A + A A^T). The first A stays in the accumulators, in float32. Warps
// 0 .. 3 are `near` the diagonal, see half_polynomial.cuh.
__device__ inline void polynomial(int warp, int lane, unsigned X, int columns, unsigned A, int rows,
                                  unsigned P) {
  Band sums{warp % 4, lane, {}, {}};
  const auto add_product = [&](unsigned from, int steps, float factor, unsigned to, auto near) {
    sums.template add_product<decltype(near)::value>(from, steps);
    sums.each([=](float v) { return factor * v; });
    sums.template store<decltype(near)::value>(to);
  };
  const auto add = [&](unsigned from, int steps, float factor, unsigned to) {
    if (warp < 4)
      add_product(from, steps, factor, to, std::true_type{});
    else
      add_product(from, steps, factor, to, std::false_type{});
    __syncthreads();
  };
  add(X, columns, 1, A);
  sums.each([](float v) { return kB / kC * v; });
  add(A, rows, kC, P);
}

class WarpIteration {
 public:
  __device__ float* pair(int v) { return X_[v / 16][v / 2 % 8] + v % 2 * 2; }
  __device__ int row(int v) const { return warp_ / 2 * 32 + v / 16 * 16 + v % 2 * 8 + lane_ / 4; }
  __device__ int column(int v) const { return warp_ % 2 * 64 + v / 2 % 8 * 8 + lane_ % 4 * 2; }

  __device__ void store(unsigned square) const {
    store_tile<2, 8, false>(square, warp_ / 2 * 2, warp_ % 2 * 8, lane_, X_);
  }
  static __device__ void publish() { __syncthreads(); }

  __device__ void advance(unsigned A, unsigned P, unsigned X, int rows, int columns) {
    polynomial(warp_, lane_, X, columns, A, rows, P);
#pragma unroll
    for (int v = 0; v < 2 * kPairs; ++v) pair(v / 2)[v % 2] *= kA;
    Terms even, odd;
    load(even, P, X, 0);
#pragma unroll 1
    for (int k = 0; k < rows; k += 2) {
      load(odd, P, X, k + 1);
      multiply_add<2, 4>(X_, even.left, even.right);
      load(even, P, X, k + 2);
      multiply_add<2, 4>(X_, odd.left, odd.right);
    }
  }

 private:
  struct Terms {
    Fragment left[2], right[4];
  };
  __device__ void load(Terms& t, unsigned P, unsigned X, int k) const {
    constexpr unsigned rows = 16 * kRowBytes;
    const unsigned own = (P + left_lane(lane_)) ^ (k % 8 * 32);
    const unsigned down = X + left_lane(lane_) + k % 8 * rows;
#pragma unroll
    for (int i = 0; i < 2; ++i) t.left[i] = half_square::load(own + (warp_ / 2 * 2 + i) * rows);
#pragma unroll
    for (int j = 0; j < 4; ++j) t.right[j] = load_flipped(down ^ ((warp_ % 2 * 4 + j) * 32));
  }

  const int warp_ = threadIdx.x / 32, lane_ = threadIdx.x % 32;
  Sum X_[2][8];
};

}  // namespace granpinn::cuda::half_square
