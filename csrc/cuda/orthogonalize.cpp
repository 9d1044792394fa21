// granpinn::orthogonalize on the GPU: the iteration of cpu/orthogonalize.h, all matrices in one
// batched product of torch. Nothing is synchronised: it can be captured in a CUDA graph.
#include <ATen/ATen.h>
#include <torch/library.h>

#include "arguments.h"

namespace granpinn::cuda {

at::Tensor orthogonalize(const at::Tensor& G) {
  check_matrices(G);
  const std::int64_t m = G.size(-2), n = G.size(-1);
  if (G.numel() == 0) return at::empty(G.sizes(), G.options());
  const double a = 3.4445, b = -4.7750, c = 2.0315;
  const at::Tensor stack = G.reshape({-1, m, n});
  const at::Tensor norm = at::linalg_vector_norm(stack, 2, at::IntArrayRef{1, 2}, true);
  at::Tensor X = stack / norm.clamp_min(1e-30);
  if (m > n) X = X.transpose(1, 2);
  for (int step = 0; step < 5; ++step) {
    const at::Tensor A = at::bmm(X, X.transpose(1, 2));
    X = at::baddbmm(X, at::baddbmm(A, A, A, b, c), X, a, 1);
  }
  if (m > n) X = X.transpose(1, 2);
  return X.contiguous().view(G.sizes());
}

TORCH_LIBRARY_IMPL(granpinn, CUDA, m) { m.impl("orthogonalize", &orthogonalize); }

}  // namespace granpinn::cuda
