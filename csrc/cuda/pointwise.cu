// The operators that act point by point.
#include "launch.h"
#include "launcher.cuh"
#include "math/forms/mixed.h"
#include "math/forms/strong.h"
#include "math/philox.h"
#include "math/viscosity.h"

namespace granpinn::cuda {

namespace {

constexpr int kThreads = 128;

__device__ std::int64_t index() {
  return static_cast<std::int64_t>(blockIdx.x) * kThreads + threadIdx.x;
}

template <class T>
struct LawValues {
  T theta[kMaxLawParameters];

  __device__ LawValues(LawName law, const T* from) {
    const int parameters = parameters_of(law);
    for (int k = 0; k < kMaxLawParameters; ++k) theta[k] = k < parameters ? from[k] : T(0);
  }
};

template <class T>
__global__ void viscosity_kernel(const ViscosityArguments<T> a) {
  const std::int64_t i = index();
  if (i >= a.n) return;
  const LawValues<T> values(a.law, a.theta);
  visit_law(a.law, [&](auto law) {
    a.eta[i] = viscosity<decltype(law)>(a.gamma_dot[i], a.p[i], values.theta, a.physics);
  });
}

template <class T>
__global__ void viscosity_adjoint_kernel(const ViscosityArguments<T> a) {
  const std::int64_t i = index();
  if (i >= a.n) return;
  const LawValues<T> values(a.law, a.theta);
  visit_law(a.law, [&](auto law) {
    using Law = decltype(law);
    T theta_a[kMaxLawParameters] = {};
    viscosity_adjoint<Law>(a.gamma_dot[i], a.p[i], values.theta, a.physics, a.grad[i],
                           a.grad_gamma_dot[i], a.grad_p[i], theta_a);
    for (int k = 0; k < Law::parameters; ++k) a.grad_theta[i * Law::parameters + k] = theta_a[k];
  });
}

template <class F, class T>
__global__ void residual_kernel(const ResidualArguments<T> a) {
  const std::int64_t i = index();
  if (i >= a.n) return;
  const LawValues<T> values(a.law, a.theta);
  T z[F::fields][F::channels], e[F::residuals];
  for (int k = 0; k < F::fields; ++k)
    for (int c = 0; c < F::channels; ++c) z[k][c] = a.jets[(c * a.n + i) * a.fields + k];
  visit_law(a.law,
            [&](auto law) { residuals_of<F, decltype(law)>(z, values.theta, a.physics, e); });
  for (int r = 0; r < F::residuals; ++r) a.out[i * F::residuals + r] = e[r];
}

__global__ void sample_kernel(const std::int64_t* step, std::uint64_t seed, std::uint32_t stream_id,
                              std::int64_t count, std::uint64_t population, std::int64_t* out) {
  const std::int64_t i = index();
  if (i < count)
    out[i] = sample_index(seed, static_cast<std::uint64_t>(*step), stream_id,
                          static_cast<std::uint32_t>(i), population);
}

template <class... Parameters, class... Arguments>
cudaError_t each_point(cudaStream_t stream, std::int64_t n, void (*kernel)(Parameters...),
                       Arguments... arguments) {
  Launcher run(stream);
  if (n > 0) run(kernel, dim3(blocks_of(n, kThreads)), dim3(kThreads), arguments...);
  return run.status();
}

}  // namespace

template <class T>
cudaError_t viscosity_values(const ViscosityArguments<T>& a, cudaStream_t stream) {
  return each_point(stream, a.n, viscosity_kernel<T>, a);
}

template <class T>
cudaError_t viscosity_gradient(const ViscosityArguments<T>& a, cudaStream_t stream) {
  return each_point(stream, a.n, viscosity_adjoint_kernel<T>, a);
}

template <class T>
cudaError_t residuals(const ResidualArguments<T>& a, cudaStream_t stream) {
  const auto kernel = a.form == Form::mixed ? residual_kernel<MixedForm, T>
                      : a.softplus          ? residual_kernel<StrongForm<PressureMap::softplus>, T>
                                            : residual_kernel<StrongForm<PressureMap::linear>, T>;
  return each_point(stream, a.n, kernel, a);
}

cudaError_t draw_indices(const std::int64_t* step, std::uint64_t seed, std::uint32_t stream_id,
                         std::int64_t count, std::uint64_t population, std::int64_t* out,
                         cudaStream_t stream) {
  return each_point(stream, count, sample_kernel, step, seed, stream_id, count, population, out);
}

#define GRANPINN_INSTANTIATE(T)                                                        \
  template cudaError_t viscosity_values(const ViscosityArguments<T>&, cudaStream_t);   \
  template cudaError_t viscosity_gradient(const ViscosityArguments<T>&, cudaStream_t); \
  template cudaError_t residuals(const ResidualArguments<T>&, cudaStream_t);

GRANPINN_INSTANTIATE(float)
GRANPINN_INSTANTIATE(double)

}  // namespace granpinn::cuda
