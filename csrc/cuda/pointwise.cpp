// The operators that act point by point, on the GPU.
#include "ops.h"
#include "point_arguments.h"

namespace granpinn::cuda {

at::Tensor viscosity(const at::Tensor& gamma_dot, const at::Tensor& p, const at::Tensor& theta,
                     double d, double eta_min, double eta_max, double p_floor) {
  check_viscosity(gamma_dot, p, theta);
  const c10::cuda::CUDAGuard guard(gamma_dot.device());
  const at::Tensor rate = gamma_dot.contiguous(), pressure = p.contiguous();
  const at::Tensor law = theta.contiguous();
  at::Tensor eta = at::empty_like(rate);
  AT_DISPATCH_FLOATING_TYPES(rate.scalar_type(), "viscosity", [&] {
    check(viscosity_values<scalar_t>(
              rheology_constants<scalar_t>(d, eta_min, eta_max, p_floor),
              law.const_data_ptr<scalar_t>(), rate.const_data_ptr<scalar_t>(),
              pressure.const_data_ptr<scalar_t>(), rate.size(0), eta.mutable_data_ptr<scalar_t>(),
              nullptr, c10::cuda::getCurrentCUDAStream()),
          "viscosity");
  });
  return eta;
}

// (d eta / d gamma_dot, d eta / d p, d eta / d theta) applied to grad: [N], [N], [3].
std::tuple<at::Tensor, at::Tensor, at::Tensor> viscosity_backward(
    const at::Tensor& grad, const at::Tensor& gamma_dot, const at::Tensor& p,
    const at::Tensor& theta, double d, double eta_min, double eta_max, double p_floor) {
  check_viscosity(gamma_dot, p, theta);
  const c10::cuda::CUDAGuard guard(gamma_dot.device());
  const at::Tensor rate = gamma_dot.contiguous(), pressure = p.contiguous();
  const at::Tensor law = theta.contiguous();
  at::Tensor derivatives = at::empty({rate.size(0), 5}, rate.options());
  AT_DISPATCH_FLOATING_TYPES(rate.scalar_type(), "viscosity_backward", [&] {
    check(viscosity_values<scalar_t>(
              rheology_constants<scalar_t>(d, eta_min, eta_max, p_floor),
              law.const_data_ptr<scalar_t>(), rate.const_data_ptr<scalar_t>(),
              pressure.const_data_ptr<scalar_t>(), rate.size(0), nullptr,
              derivatives.mutable_data_ptr<scalar_t>(), c10::cuda::getCurrentCUDAStream()),
          "viscosity_backward");
  });
  const at::Tensor scaled = derivatives * grad.unsqueeze(1);
  return {scaled.select(1, 0).contiguous(), scaled.select(1, 1).contiguous(),
          scaled.slice(1, 2).sum(0)};
}

at::Tensor pointwise_residuals(const at::Tensor& raw_jets, const at::Tensor& theta, Doubles physics,
                               c10::string_view form) {
  const Form kind = check_jets(raw_jets, theta, form);
  const c10::cuda::CUDAGuard guard(raw_jets.device());
  const at::Tensor jets = raw_jets.contiguous(), law = theta.contiguous();
  at::Tensor out = at::empty({jets.size(1), kind == Form::mixed ? 5 : 3}, jets.options());
  AT_DISPATCH_FLOATING_TYPES(jets.scalar_type(), "pointwise_residuals", [&] {
    check(residuals<scalar_t>(kind, physics_of<scalar_t>(physics), law.const_data_ptr<scalar_t>(),
                              jets.const_data_ptr<scalar_t>(), jets.size(1), jets.size(2),
                              out.mutable_data_ptr<scalar_t>(), c10::cuda::getCurrentCUDAStream()),
          "pointwise_residuals");
  });
  return out;
}

at::Tensor sample_indices(const at::Tensor& step, std::int64_t seed, std::int64_t stream,
                          std::int64_t count, std::int64_t population) {
  check_sampling(step, count, population);
  const c10::cuda::CUDAGuard guard(step.device());
  at::Tensor out = at::empty({count}, step.options());
  check(draw_indices(step.const_data_ptr<std::int64_t>(), static_cast<std::uint64_t>(seed),
                     static_cast<std::uint32_t>(stream), count,
                     static_cast<std::uint64_t>(population), out.mutable_data_ptr<std::int64_t>(),
                     c10::cuda::getCurrentCUDAStream()),
        "sample_indices");
  return out;
}

}  // namespace granpinn::cuda
