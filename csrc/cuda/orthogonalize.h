// Muon's matrices, from tensors to the structs that the kernels take.
#pragma once

#include <ATen/ATen.h>

#include "muon/newton_schulz.h"

namespace granpinn::cuda {

// G [..., m, n] as [groups, count, m, n], no gap within a matrix: where it is if that can be seen
// so, else a copy.
inline at::Tensor spread(const at::Tensor& G) {
  const std::int64_t m = G.size(-2), n = G.size(-1);
  const bool dense = G.dim() <= 4 && G.stride(-1) == 1 && G.stride(-2) == n;
  at::Tensor out = dense ? G : G.contiguous();
  if (out.dim() > 4) return out.view({1, -1, m, n});
  while (out.dim() < 4) out = out.unsqueeze(0);
  return out;
}

// Of a tensor that `spread` gave; its memory must live as long.
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
