// granpinn::orthogonalize on the GPU: small matrices with the kernels in muon/, large ones with
// batched products of torch. It never waits for the GPU, so a CUDA graph can capture it.
#include "orthogonalize.h"

#include <algorithm>
#include <type_traits>

#include "backend.h"

namespace granpinn::cuda {

namespace {

constexpr std::int64_t kSmall = 256;   // largest smaller side
constexpr std::int64_t kMost = 65535;  // matrices of a launch

template <class T>
cudaError_t launch(NewtonSchulz<T>& a, bool fast, const at::Tensor& like) {
  const auto stream = c10::cuda::getCurrentCUDAStream();
  if constexpr (std::is_same_v<T, float>)
    if (fast && newton_schulz_fits_half(a.m, a.n)) return newton_schulz_in_half(a, stream);
  const at::Tensor scratch = at::empty({newton_schulz_scratch(a)}, like.options());
  a.scratch = scratch.mutable_data_ptr<T>();
  return newton_schulz(a, stream);
}

at::Tensor small(const at::Tensor& G, bool fast) {
  const at::Tensor from = spread(G);
  at::Tensor out = at::empty(G.sizes(), G.options());
  AT_DISPATCH_FLOATING_TYPES(G.scalar_type(), "orthogonalize", [&] {
    NewtonSchulz<scalar_t> a = matrices<scalar_t>(from);
    a.out = out.mutable_data_ptr<scalar_t>();
    check(launch(a, fast, G), "orthogonalize");
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

at::Tensor CudaBackend::orthogonalize(const at::Tensor& G, c10::string_view precision) {
  check_matrices(G);
  const bool fast = fast_precision(precision);
  const c10::DeviceGuard guard(G.device());
  const std::int64_t m = G.size(-2), n = G.size(-1);
  if (G.numel() == 0) return at::empty(G.sizes(), G.options());
  return std::min(m, n) <= kSmall && G.numel() / (m * n) <= kMost ? small(G, fast) : large(G);
}

}  // namespace granpinn::cuda
