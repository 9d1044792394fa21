// The iteration of Muon on the GPU (cpu/orthogonalize.h has the formula) for matrices so small that
// the launch of a library product costs more than its arithmetic.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

namespace granpinn::cuda {

// Matrices [m, n], `groups` times `count` of them: number l of group g starts at
// G + g group_stride + l stride.
template <class T>
struct NewtonSchulz {
  const T* G;
  std::int64_t groups, count, group_stride, stride, m, n;
  T* out;      // [groups, count, m, n]
  T* scratch;  // newton_schulz_scratch scalars
};

template <class T>
std::int64_t newton_schulz_scratch(const NewtonSchulz<T>& a) {
  const std::int64_t r = a.m < a.n ? a.m : a.n;
  return a.groups * a.count * 2 * (a.m * a.n + r * r);
}

// 16 launches; nothing is waited for.
template <class T>
cudaError_t newton_schulz(const NewtonSchulz<T>& a, cudaStream_t stream);

}  // namespace granpinn::cuda
