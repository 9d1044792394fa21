// The operators that act point by point.
#include "launch.h"
#include "launcher.cuh"
#include "math/dual.h"
#include "math/mixed_form.h"
#include "math/philox.h"
#include "math/strong_form.h"

namespace granpinn::cuda {

namespace {

constexpr int kThreads = 128;

__device__ std::int64_t index() {
  return static_cast<std::int64_t>(blockIdx.x) * kThreads + threadIdx.x;
}

template <class T>
__global__ void viscosity_kernel(Physics<T> physics, const T* theta, const T* gamma_dot, const T* p,
                                 std::int64_t n, T* eta, T* derivatives) {
  using D = Dual<T, 5>;
  const std::int64_t i = index();
  if (i >= n) return;
  const FrictionLaw<D> law{D(theta[0], 2), D(theta[1], 3), D(theta[2], 4)};
  const D value = viscosity(D(gamma_dot[i], 0), D(p[i], 1), law, physics);
  if (eta) eta[i] = value.value;
  for (int k = 0; derivatives && k < 5; ++k) derivatives[i * 5 + k] = value.d[k];
}

template <class F, class T>
__global__ void residual_kernel(Physics<T> physics, const T* theta, const T* jets, std::int64_t n,
                                std::int64_t fields, T* out) {
  const std::int64_t i = index();
  if (i >= n) return;
  T z[F::fields][F::channels], e[F::residuals];
  for (int k = 0; k < F::fields; ++k)
    for (int c = 0; c < F::channels; ++c) z[k][c] = jets[(c * n + i) * fields + k];
  residuals_of<F>(z, FrictionLaw<T>{theta[0], theta[1], theta[2]}, physics, e);
  for (int r = 0; r < F::residuals; ++r) out[i * F::residuals + r] = e[r];
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
cudaError_t viscosity_values(const Physics<T>& physics, const T* theta, const T* gamma_dot,
                             const T* p, std::int64_t n, T* eta, T* derivatives,
                             cudaStream_t stream) {
  return each_point(stream, n, viscosity_kernel<T>, physics, theta, gamma_dot, p, n, eta,
                    derivatives);
}

template <class T>
cudaError_t residuals(Form form, const Physics<T>& physics, const T* theta, const T* jets,
                      std::int64_t n, std::int64_t fields, T* out, cudaStream_t stream) {
  // a network of five outputs is that of the mixed form, whose pressure is a softplus
  const auto kernel = form == Form::mixed ? residual_kernel<MixedForm, T>
                      : fields == MixedForm::fields
                          ? residual_kernel<StrongForm<PressureMap::softplus>, T>
                          : residual_kernel<StrongForm<PressureMap::linear>, T>;
  return each_point(stream, n, kernel, physics, theta, jets, n, fields, out);
}

cudaError_t draw_indices(const std::int64_t* step, std::uint64_t seed, std::uint32_t stream_id,
                         std::int64_t count, std::uint64_t population, std::int64_t* out,
                         cudaStream_t stream) {
  return each_point(stream, count, sample_kernel, step, seed, stream_id, count, population, out);
}

template cudaError_t viscosity_values(const Physics<float>&, const float*, const float*,
                                      const float*, std::int64_t, float*, float*, cudaStream_t);
template cudaError_t viscosity_values(const Physics<double>&, const double*, const double*,
                                      const double*, std::int64_t, double*, double*, cudaStream_t);
template cudaError_t residuals(Form, const Physics<float>&, const float*, const float*,
                               std::int64_t, std::int64_t, float*, cudaStream_t);
template cudaError_t residuals(Form, const Physics<double>&, const double*, const double*,
                               std::int64_t, std::int64_t, double*, cudaStream_t);

}  // namespace granpinn::cuda
