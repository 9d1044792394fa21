// granpinn::orthogonalize on the GPU: small matrices by own kernels, large ones by batched products
// of torch. Nothing is synchronised: it can be captured in a CUDA graph.
#include <c10/core/DeviceGuard.h>
#include <c10/cuda/CUDAStream.h>
#include <torch/library.h>

#include <algorithm>

#include "arguments.h"
#include "newton_schulz.h"

namespace granpinn::cuda {

namespace {

constexpr std::int64_t kSmall = 256;   // largest smaller side
constexpr std::int64_t kMost = 65535;  // matrices of a launch

at::Tensor small(const at::Tensor& G) {
  const std::int64_t m = G.size(-2), n = G.size(-1);
  // matrices without gaps that lie apart in one or two regular ways are taken where they are
  const bool regular = G.dim() <= 4 && G.stride(-1) == 1 && G.stride(-2) == n;
  const at::Tensor from = regular ? G : G.contiguous().view({-1, m, n});
  const std::int64_t rank = from.dim();
  at::Tensor out = at::empty(G.sizes(), G.options());
  AT_DISPATCH_FLOATING_TYPES(G.scalar_type(), "orthogonalize", [&] {
    NewtonSchulz<scalar_t> a{};
    a.G = from.const_data_ptr<scalar_t>();
    a.groups = rank > 3 ? from.size(0) : 1;
    a.group_stride = rank > 3 ? from.stride(0) : 0;
    a.count = rank > 2 ? from.size(-3) : 1;
    a.stride = rank > 2 ? from.stride(-3) : 0;
    a.m = m;
    a.n = n;
    a.out = out.mutable_data_ptr<scalar_t>();
    const at::Tensor scratch = at::empty({newton_schulz_scratch(a)}, G.options());
    a.scratch = scratch.mutable_data_ptr<scalar_t>();
    const cudaError_t status = newton_schulz(a, c10::cuda::getCurrentCUDAStream());
    TORCH_CHECK(status == cudaSuccess, "granpinn::orthogonalize could not be launched on the GPU: ",
                cudaGetErrorString(status), "; see python -m granpinn.doctor");
  });
  return out;
}

at::Tensor large(const at::Tensor& G) {
  const std::int64_t m = G.size(-2), n = G.size(-1);
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

}  // namespace

at::Tensor orthogonalize(const at::Tensor& G) {
  check_matrices(G);
  const c10::DeviceGuard guard(G.device());
  const std::int64_t m = G.size(-2), n = G.size(-1);
  if (G.numel() == 0) return at::empty(G.sizes(), G.options());
  return std::min(m, n) <= kSmall && G.numel() / (m * n) <= kMost ? small(G) : large(G);
}

TORCH_LIBRARY_IMPL(granpinn, CUDA, m) { m.impl("orthogonalize", &orthogonalize); }

}  // namespace granpinn::cuda
