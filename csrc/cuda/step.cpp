// One optimization step and the operators that act point by point, on the GPU.
//
// This file registers the CUDA backend: the templates of CudaBackend are instantiated here.
#include <type_traits>

#include "../ops/registration.h"
#include "backend.h"
#include "orthogonalize.h"
#include "step_launch.h"

namespace granpinn::cuda {

namespace {

cudaStream_t stream() { return c10::cuda::getCurrentCUDAStream(); }

}  // namespace

template <class T>
void CudaBackend::draw(const BatchArguments<T>& a) {
  check(draw_batch(a, stream()), "draw_batch");
}

template <class T>
void CudaBackend::update(const UpdateArguments<T>& a) {
  check(cuda::update(a, stream()), "update");
}

template <class T>
void CudaBackend::descend(DescendArguments<T> a, const at::Tensor& G, c10::string_view precision) {
  if constexpr (std::is_same_v<T, float>)
    if (fast_precision(precision) && newton_schulz_fits_half(G.size(2), G.size(3))) {
      const at::Tensor from = spread(G);
      return check(descend_in_half(matrices<T>(from), a, stream()), "descend");
    }
  const at::Tensor factors = orthogonalize(G, precision);
  a.U = factors.const_data_ptr<T>();
  check(descend_matrices(a, stream()), "descend");
}

template <class T>
void CudaBackend::viscosity(const ViscosityArguments<T>& a) {
  check(viscosity_values(a, stream()), "viscosity");
}

template <class T>
void CudaBackend::viscosity_adjoint(const ViscosityArguments<T>& a) {
  check(viscosity_gradient(a, stream()), "viscosity_backward");
}

template <class T>
void CudaBackend::residuals(const ResidualArguments<T>& a) {
  check(cuda::residuals(a, stream()), "pointwise_residuals");
}

void CudaBackend::sample(const std::int64_t* step, std::uint64_t seed, std::uint32_t stream_id,
                         std::int64_t count, std::uint64_t population, std::int64_t* out) {
  check(draw_indices(step, seed, stream_id, count, population, out, stream()), "sample_indices");
}

TORCH_LIBRARY_IMPL(granpinn, CUDA, m) { register_operators<CudaBackend>(m); }

}  // namespace granpinn::cuda
