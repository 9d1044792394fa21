// Muon's matrices: tensors as the structs that the kernels take.
#pragma once

#include <ATen/ATen.h>

#include "muon/newton_schulz.h"

namespace granpinn::cuda {

// G [..., m, n] as [groups, count, m, n] without gaps inside a matrix: a view of G if its strides
// allow it, else a copy.
inline at::Tensor spread(const at::Tensor& G) {
  const std::int64_t m = G.size(-2), n = G.size(-1);
  const bool dense = G.dim() <= 4 && G.stride(-1) == 1 && G.stride(-2) == n;
  at::Tensor out = dense ? G : G.contiguous();
  if (out.dim() > 4) return out.view({1, -1, m, n});
  while (out.dim() < 4) out = out.unsqueeze(0);
  return out;
}

// The struct of a tensor that `spread` returned. The tensor must outlive it.
template <class T>
NewtonSchulz<T> matrices(const at::Tensor& G) {
  NewtonSchulz<T> a{};
  a.G = G.const_data_ptr<T>();
  a.groups = G.size(0);
  a.count = G.size(1);
  a.group_stride = G.stride(0);
  a.stride = G.stride(1);
  a.m = G.size(2);
  a.n = G.size(3);
  return a;
}

}  // namespace granpinn::cuda
