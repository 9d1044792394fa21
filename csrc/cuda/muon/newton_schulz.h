// The Newton-Schulz iteration of Muon on the GPU, from X = G / |G|_F, five times
//
//   A = X X^T,   P = b A + c A^2,   X <- a X + P X      (source: cpu/orthogonalize.h)
//
// for matrices so small that the launch of a library product costs more than its arithmetic.
//
//   file                      precision           sides        launches
//   newton_schulz.cu          float32, float64    any          16
//   newton_schulz_cluster.cu  float32             up to 128    1, a cluster of blocks for a matrix
//   newton_schulz_half.cu     half and float32    up to 128    1, a block for a matrix
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "../../step.h"

namespace granpinn::cuda {

// groups * count matrices [m, n]: matrix l of group g starts at G + g group_stride + l stride.
template <class T>
struct NewtonSchulz {
  const T* G;
  std::int64_t groups, count, group_stride, stride, m, n;
  T* out;      // [groups, count, m, n]
  T* scratch;  // newton_schulz_scratch scalars; none in half precision
};

// Blocks of the cluster that shares a matrix with sides up to 128: 2, 4 or 8, of 16 rows each.
inline int newton_schulz_blocks(std::int64_t m, std::int64_t n) {
  const std::int64_t r = m < n ? m : n;
  return r <= 32 ? 2 : r <= 64 ? 4 : 8;
}

// Whether newton_schulz_in_clusters is used, where the GPU has clusters. More than a thousand
// matrices fill the GPU without clusters, which would add much padding to small matrices.
template <class T>
bool newton_schulz_fits_clusters(const NewtonSchulz<T>& a) {
  return sizeof(T) == sizeof(float) && a.m <= 128 && a.n <= 128 && a.groups * a.count <= 1000;
}

// Scalars of scratch memory.
template <class T>
std::int64_t newton_schulz_scratch(const NewtonSchulz<T>& a) {
  const std::int64_t r = a.m < a.n ? a.m : a.n, plain = a.m * a.n + r * r;
  const std::int64_t padded = 16 * 128 * newton_schulz_blocks(a.m, a.n);
  const bool clusters = newton_schulz_fits_clusters(a) && padded > plain;
  return a.groups * a.count * 2 * (clusters ? padded : plain);
}

// 16 launches, or one in clusters; it returns without waiting for the GPU.
template <class T>
cudaError_t newton_schulz(const NewtonSchulz<T>& a, cudaStream_t stream);

// One launch for GPUs with clusters (compute capability 9.0 and above), if the matrices fit.
bool newton_schulz_has_clusters();
cudaError_t newton_schulz_in_clusters(const NewtonSchulz<float>& a, cudaStream_t stream);

// One launch, with the operands of products in half precision. descend_in_half also updates the
// parameters with the result, W -= rate U, and does not store U; its groups are members.
inline bool newton_schulz_fits_half(std::int64_t m, std::int64_t n) { return m <= 128 && n <= 128; }
cudaError_t newton_schulz_in_half(const NewtonSchulz<float>& a, cudaStream_t stream);
cudaError_t descend_in_half(const NewtonSchulz<float>& a, const DescendArguments<float>& d,
                            cudaStream_t stream);

}  // namespace granpinn::cuda
