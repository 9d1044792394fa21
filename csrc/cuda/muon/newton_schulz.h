// The iteration of Muon on the GPU (cpu/orthogonalize.h has the formula) for matrices so small that
// the launch of a library product costs more than its arithmetic.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "../../step.h"

namespace granpinn::cuda {

// Matrices [m, n], `groups` times `count` of them: number l of group g starts at
// G + g group_stride + l stride.
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

// Whether one launch does it, newton_schulz_in_clusters. A thousand matrices fill the GPU in any
// way, and in clusters small ones would be padded much.
template <class T>
bool newton_schulz_fits_clusters(const NewtonSchulz<T>& a) {
  return sizeof(T) == sizeof(float) && a.m <= 128 && a.n <= 128 && a.groups * a.count <= 1000;
}

template <class T>
std::int64_t newton_schulz_scratch(const NewtonSchulz<T>& a) {
  const std::int64_t r = a.m < a.n ? a.m : a.n, plain = a.m * a.n + r * r;
  const std::int64_t padded = 16 * 128 * newton_schulz_blocks(a.m, a.n);
  const bool clusters = newton_schulz_fits_clusters(a) && padded > plain;
  return a.groups * a.count * 2 * (clusters ? padded : plain);
}

// 16 launches, or one where the GPU has clusters; nothing is waited for.
template <class T>
cudaError_t newton_schulz(const NewtonSchulz<T>& a, cudaStream_t stream);

// One launch for GPUs with clusters (compute capability 9.0 and above), if the matrices fit.
bool newton_schulz_has_clusters();
cudaError_t newton_schulz_in_clusters(const NewtonSchulz<float>& a, cudaStream_t stream);

// One launch with operands of products in half precision, a block for each matrix. In the second,
// groups are members, and U goes to the parameters alone.
inline bool newton_schulz_fits_half(std::int64_t m, std::int64_t n) { return m <= 128 && n <= 128; }
cudaError_t newton_schulz_in_half(const NewtonSchulz<float>& a, cudaStream_t stream);
cudaError_t descend_in_half(const NewtonSchulz<float>& a, const DescendArguments<float>& d,
                            cudaStream_t stream);

}  // namespace granpinn::cuda
