// U V^T of G = U S V^T to about 30 %: five steps of the quintic Newton-Schulz iteration of Muon
// (Jordan et al., "Muon: an optimizer for hidden layers in neural networks", 2024),
//
//   A = X X^T,  B = a I + (b I + c A) A,  X <- B X,  from X = G / |G|_F.
//
//   a matrix: panels of 32 columns             a symmetric product: blocks of 32 x 32
//             panel 0   panel 1                        J = 0     1
//           +---------+---------+                   +-------+-------+
//   block 0 | row 0   |         |            I = 0  | made  | copy^T|
//           | row 1   |         |                   +-------+-------+
//   block 1 |  ...    |         |                1  | made  | made  |
//           +---------+---------+                   +-------+-------+
//
//   name  shape             layout
//   X, Y  R x C             [columns / 32][rows][32]; rows and columns padded with zeros
//   A, B  R x R             the same; r <= c are the sides of G, R and C these padded to 32
//
// So every product is one for the micro-kernel of gemm.h.
#pragma once

#include "transpose.h"

namespace granpinn {
namespace GRANPINN_SIMD_NAMESPACE {

constexpr std::ptrdiff_t kBlock = static_cast<std::ptrdiff_t>(kTile) * kTile;

// out = left right, [rows, inner] x [inner, columns]. If symmetric, only blocks on and below the
// diagonal are multiplied. All sizes are multiples of kTile.
template <class T>
void panel_product(const T* left, const T* right, std::ptrdiff_t rows, std::ptrdiff_t inner,
                   std::ptrdiff_t columns, bool symmetric, T* out) {
  for (std::ptrdiff_t J = 0; J < columns / kTile; ++J) {
    const std::ptrdiff_t top = symmetric ? J * kTile : 0;
    const Product<T> g{left + top * kTile,
                       kTile,
                       1,
                       rows * kTile,
                       right + J * inner * kTile,
                       kBlock,
                       kTile,
                       static_cast<int>(inner / kTile),
                       out + (J * rows + top) * kTile,
                       kTile,
                       nullptr,
                       false};
    product(g, static_cast<int>(rows - top));
    for (std::ptrdiff_t I = J + 1; symmetric && I < rows / kTile; ++I)
      transpose(out + J * rows * kTile + I * kBlock, out + I * rows * kTile + J * kBlock);
  }
}

// Position of element (i, j) in a matrix of `rows` rows.
inline __attribute__((always_inline)) std::ptrdiff_t panel_at(std::ptrdiff_t rows, std::ptrdiff_t i,
                                                              std::ptrdiff_t j) {
  return (j / kTile * rows + i) * kTile + j % kTile;
}

// G, out: [m, n]. workspace: orthogonalize_workspace(m, n) scalars.
template <class T>
void orthogonalize(const T* G, std::int64_t m, std::int64_t n, T* out, T* workspace) {
  using V = Vec<T>;
  const bool tall = m > n;
  const std::ptrdiff_t r = tall ? n : m, c = tall ? m : n;  // X is [r, c] with r <= c
  const std::ptrdiff_t R = padded(r), C = padded(c);
  T *X = workspace, *Y = X + R * C, *A = Y + R * C, *B = A + R * R;
  double square = 0;
  for (std::ptrdiff_t i = 0; i < m * n; ++i) square += static_cast<double>(G[i]) * G[i];
  const double norm = square > 0 ? __builtin_sqrt(square) : 1;
  const T scale = static_cast<T>(1 / norm);
  for (std::ptrdiff_t i = 0; i < R * C; ++i) X[i] = T(0);
  for (std::ptrdiff_t i = 0; i < r; ++i)
    for (std::ptrdiff_t j = 0; j < c; ++j)
      X[panel_at(R, i, j)] = scale * (tall ? G[j * n + i] : G[i * n + j]);
  constexpr T a = T(3.4445), b = T(-4.7750), c3 = T(2.0315);
  for (int step = 0; step < 5; ++step) {
    for (std::ptrdiff_t I = 0; I < R / kTile; ++I)
      for (std::ptrdiff_t J = 0; J < C / kTile; ++J)
        transpose(X + J * R * kTile + I * kBlock, Y + I * C * kTile + J * kBlock);
    panel_product(X, Y, R, C, R, true, A);
    for (std::ptrdiff_t i = 0; i < R * R; i += kLanes<T>) (V(c3) * V::load(A + i)).store(Y + i);
    for (std::ptrdiff_t i = 0; i < r; ++i) Y[panel_at(R, i, i)] += b;
    panel_product(Y, A, R, R, R, true, B);
    for (std::ptrdiff_t i = 0; i < r; ++i) B[panel_at(R, i, i)] += a;
    panel_product(B, X, R, R, C, false, Y);
    T* done = X;
    X = Y;
    Y = done;
  }
  for (std::ptrdiff_t i = 0; i < r; ++i)
    for (std::ptrdiff_t j = 0; j < c; ++j)
      (tall ? out[j * n + i] : out[i * n + j]) = X[panel_at(R, i, j)];
}

}  // namespace GRANPINN_SIMD_NAMESPACE
}  // namespace granpinn
