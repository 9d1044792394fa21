// Products of matrices for a batch, tile by tile through shared memory:
//
//   out(m, n) = sum_k a(m, k) b(k, n) + bias(n)
//
//                                       BN = 16 TN columns n
//                                     +--------------------+
//                        kDepth = 16  |       tile_b       |     shared
//                  k                  +--------------------+
//               +--------+            +--------------------+
//   BM = 16 TM  | tile_a |            | outputs of a block |     16 x 16 threads (ty, tx),
//   rows m      +--------+            +--------------------+     TM x TN neighbours each
//
//   name            shape            where      layout
//   a               M x K            global     k fast (AKFast) or m fast, a_stride the other way
//   b               K x N            global     k fast (BKFast) or n fast, b_stride the other way
//   tile_a, tile_b  16 x BM, 16 x BN shared     [k][m or n], four columns of padding
//   next_a, next_b  TM, TN           registers  a thread's part of the next tiles
//   sum             TM x TN          registers
//
// Every output is one sum over k in ascending order, so results depend neither on the grid nor on
// the batch.
#pragma once

#include "launcher.cuh"

namespace granpinn::cuda {

// The operands and sizes of a product. With several slices, each sums over its own range of k.
template <class T>
struct Product {
  const T *a, *b;
  std::int64_t a_stride, b_stride;  // of the slow axis: AKFast, BKFast
  std::int64_t a_batch, b_batch;    // between members
  T* out;                           // [members][slices][M, N], N contiguous
  std::int64_t out_batch;           // between slices (and so between members)
  const T* bias;                    // [N], added to rows m < bias_rows; or null
  std::int64_t bias_batch;
  int bias_rows;
  int M, N, K;
  int slices, slice;  // number of slices, number of k in one
};

constexpr int kProductThreads = 256;
constexpr int kDepth = 16;  // number of k in shared memory at a time

// Element (i, k) of an operand: k is the fast axis if KFast, else i. Zero outside.
template <bool KFast, class T>
__device__ __forceinline__ T operand(const T* data, std::int64_t stride, int i, int k, int rows,
                                     int end) {
  if (i >= rows || k >= end) return T(0);
  return KFast ? data[i * stride + k] : data[k * stride + i];
}

// Position (i, k) of element e of a tile [kDepth][Rows]: e follows the order of global memory.
template <bool KFast, int Rows>
__device__ __forceinline__ void tile_position(int e, int* i, int* k) {
  *i = KFast ? e / kDepth : e % Rows;
  *k = KFast ? e % kDepth : e / Rows;
}

template <class T, int TM, int TN, bool AKFast, bool BKFast>
__global__ __launch_bounds__(kProductThreads) void matrix_product(
    const __grid_constant__ Product<T> p) {
  constexpr int BM = 16 * TM, BN = 16 * TN;
  // padding by 4: rows stay aligned to 16 bytes and columns fall into different banks
  __shared__ alignas(16) T tile_a[kDepth][BM + 4];
  __shared__ alignas(16) T tile_b[kDepth][BN + 4];
  const int thread = threadIdx.x, tx = thread % 16, ty = thread / 16;
  const int m0 = blockIdx.x * BM, n0 = blockIdx.y * BN;
  const int member = blockIdx.z / p.slices, first = (blockIdx.z % p.slices) * p.slice;
  const int end = min(p.K, first + p.slice);
  const T* a = p.a + member * p.a_batch + m0 * (AKFast ? p.a_stride : 1);
  const T* b = p.b + member * p.b_batch + n0 * (BKFast ? p.b_stride : 1);
  T next_a[TM], next_b[TN], sum[TM][TN] = {};

  const auto fetch = [&](int k0) {
    int i, k;
    for (int e = 0; e < TM; ++e) {
      tile_position<AKFast, BM>(thread + e * kProductThreads, &i, &k);
      next_a[e] = operand<AKFast>(a, p.a_stride, i, k0 + k, p.M - m0, end);
    }
    for (int e = 0; e < TN; ++e) {
      tile_position<BKFast, BN>(thread + e * kProductThreads, &i, &k);
      next_b[e] = operand<BKFast>(b, p.b_stride, i, k0 + k, p.N - n0, end);
    }
  };

  fetch(first);
  for (int k0 = first; k0 < end; k0 += kDepth) {
    int i, k;
#pragma unroll
    for (int e = 0; e < TM; ++e) {
      tile_position<AKFast, BM>(thread + e * kProductThreads, &i, &k);
      tile_a[k][i] = next_a[e];
    }
#pragma unroll
    for (int e = 0; e < TN; ++e) {
      tile_position<BKFast, BN>(thread + e * kProductThreads, &i, &k);
      tile_b[k][i] = next_b[e];
    }
    __syncthreads();
    if (k0 + kDepth < end) fetch(k0 + kDepth);
#pragma unroll
    for (int d = 0; d < kDepth; ++d) {
      T va[TM], vb[TN];
#pragma unroll
      for (int e = 0; e < TM; ++e) va[e] = tile_a[d][ty * TM + e];
#pragma unroll
      for (int e = 0; e < TN; ++e) vb[e] = tile_b[d][tx * TN + e];
#pragma unroll
      for (int e = 0; e < TM; ++e)
#pragma unroll
        for (int f = 0; f < TN; ++f) sum[e][f] += va[e] * vb[f];
    }
    __syncthreads();
  }

  T* out = p.out + blockIdx.z * p.out_batch;
  const T* bias = p.bias ? p.bias + member * p.bias_batch : nullptr;
#pragma unroll
  for (int e = 0; e < TM; ++e) {
    const int m = m0 + ty * TM + e;
#pragma unroll
    for (int f = 0; f < TN; ++f) {
      const int n = n0 + tx * TN + f;
      if (m < p.M && n < p.N)
        out[static_cast<std::int64_t>(m) * p.N + n] =
            sum[e][f] + (bias && m < p.bias_rows ? bias[n] : T(0));
    }
  }
}

template <bool AKFast, bool BKFast, int TM, int TN, class T>
void launch_product(Launcher& run, const Product<T>& p, std::int64_t members) {
  const dim3 grid(blocks_of(p.M, 16 * TM), blocks_of(p.N, 16 * TN),
                  static_cast<unsigned>(members * p.slices));
  run(matrix_product<T, TM, TN, AKFast, BKFast>, grid, dim3(kProductThreads), p);
}

// Launches a product. Narrow results (first and last layer) take narrow tiles.
template <bool AKFast, bool BKFast, int TM, class T>
void product(Launcher& run, const Product<T>& p, std::int64_t members) {
  if (p.N <= 16)
    launch_product<AKFast, BKFast, TM, 1>(run, p, members);
  else
    launch_product<AKFast, BKFast, TM, 4>(run, p, members);
}

}  // namespace granpinn::cuda
