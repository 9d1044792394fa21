// The operators that act point by point: checks, and the structs for the backends.
//
// `Backend` runs each struct: viscosity(a), viscosity_adjoint(a), residuals(a), and
// sample(step, seed, stream, count, population, out).
#pragma once

#include <c10/core/DeviceGuard.h>

#include <limits>
#include <tuple>

#include "arguments.h"

namespace granpinn {

// Contiguous arguments of viscosity, to which the plain struct points.
struct ViscosityTensors {
  at::Tensor gamma_dot, p, theta;
  LawName law;

  ViscosityTensors(const at::Tensor& rate, const at::Tensor& pressure, const at::Tensor& values,
                   c10::string_view law_name)
      : law(law_of(law_name)) {
    GRANPINN_CHECK_TYPE(rate.scalar_type() == at::kFloat || rate.scalar_type() == at::kDouble,
                        "gamma_dot must be float32 or float64, got ", shape_of(rate));
    GRANPINN_CHECK_VALUE(rate.dim() == 1, "gamma_dot must be [N], got ", shape_of(rate));
    gamma_dot = rate.contiguous();
    p = shared("p", pressure, rate, 0, {rate.size(0)}).data;
    theta = shared("theta", values, rate, 0, {parameters_of(law)}).data;
  }

  template <class T>
  ViscosityArguments<T> arguments(double d, double eta_min, double eta_max, double p_floor) const {
    ViscosityArguments<T> a{};
    a.physics.grain_diameter = static_cast<T>(d);
    a.physics.eta_min = static_cast<T>(eta_min);
    a.physics.eta_max = static_cast<T>(eta_max);
    a.physics.pressure_floor = static_cast<T>(p_floor);
    a.physics.law_rate = std::numeric_limits<T>::infinity();
    a.physics.side_wall_speed = 1;
    sound(a.physics);
    a.law = law;
    a.theta = theta.const_data_ptr<T>();
    a.n = gamma_dot.size(0);
    a.gamma_dot = gamma_dot.const_data_ptr<T>();
    a.p = p.const_data_ptr<T>();
    return a;
  }
};

template <class Backend>
at::Tensor viscosity(const at::Tensor& gamma_dot, const at::Tensor& p, const at::Tensor& theta,
                     c10::string_view law, double d, double eta_min, double eta_max,
                     double p_floor) {
  const ViscosityTensors in(gamma_dot, p, theta, law);
  const c10::DeviceGuard guard(gamma_dot.device());
  at::Tensor eta = at::empty_like(in.gamma_dot);
  AT_DISPATCH_FLOATING_TYPES(eta.scalar_type(), "viscosity", [&] {
    auto a = in.arguments<scalar_t>(d, eta_min, eta_max, p_floor);
    a.eta = eta.mutable_data_ptr<scalar_t>();
    Backend::viscosity(a);
  });
  return eta;
}

// The adjoints of gamma_dot [N], p [N] and theta [parameters] from the adjoint of eta [N].
template <class Backend>
std::tuple<at::Tensor, at::Tensor, at::Tensor> viscosity_backward(
    const at::Tensor& grad, const at::Tensor& gamma_dot, const at::Tensor& p,
    const at::Tensor& theta, c10::string_view law, double d, double eta_min, double eta_max,
    double p_floor) {
  const ViscosityTensors in(gamma_dot, p, theta, law);
  const at::Tensor by_eta = shared("grad", grad, gamma_dot, 0, {gamma_dot.size(0)}).data;
  const c10::DeviceGuard guard(gamma_dot.device());
  at::Tensor by_rate = at::empty_like(in.gamma_dot), by_p = at::empty_like(in.gamma_dot);
  at::Tensor by_theta = at::empty({by_rate.size(0), parameters_of(in.law)}, by_rate.options());
  AT_DISPATCH_FLOATING_TYPES(by_rate.scalar_type(), "viscosity_backward", [&] {
    auto a = in.arguments<scalar_t>(d, eta_min, eta_max, p_floor);
    a.grad = by_eta.const_data_ptr<scalar_t>();
    a.grad_gamma_dot = by_rate.mutable_data_ptr<scalar_t>();
    a.grad_p = by_p.mutable_data_ptr<scalar_t>();
    a.grad_theta = by_theta.mutable_data_ptr<scalar_t>();
    Backend::viscosity_adjoint(a);
  });
  return {by_rate, by_p, by_theta.sum(0)};
}

template <class Backend>
at::Tensor pointwise_residuals(const at::Tensor& raw_jets, const at::Tensor& theta, Doubles physics,
                               c10::string_view form, c10::string_view law) {
  const Form kind = form_of(form);
  const LawName name = law_of(law);
  const bool mixed = kind == Form::mixed;
  GRANPINN_CHECK_VALUE(kind != Form::data, "form must be 'mixed' or 'strong', got '", form, "'");
  GRANPINN_CHECK_TYPE(raw_jets.scalar_type() == at::kFloat || raw_jets.scalar_type() == at::kDouble,
                      "raw_jets must be float32 or float64, got ", shape_of(raw_jets));
  const std::int64_t K = raw_jets.dim() == 3 ? raw_jets.size(2) : 0;
  GRANPINN_CHECK_VALUE(
      K > 0 && raw_jets.size(0) == channels_of(kind) && (K == 5 || (K == 3 && !mixed)),
      "raw_jets must be ", mixed ? "[4, N, 5]" : "[7, N, 3 or 5]", " for the ", form, " form, got ",
      shape_of(raw_jets));
  const at::Tensor jets = raw_jets.contiguous();
  const at::Tensor values = shared("theta", theta, raw_jets, 0, {parameters_of(name)}).data;
  const c10::DeviceGuard guard(raw_jets.device());
  at::Tensor out = at::empty({jets.size(1), residuals_of_form(kind)}, jets.options());
  AT_DISPATCH_FLOATING_TYPES(jets.scalar_type(), "pointwise_residuals", [&] {
    using T = scalar_t;
    Backend::residuals(ResidualArguments<T>{kind, K == 5, physics_of<T>(physics), name,
                                            values.const_data_ptr<T>(), jets.size(1), K,
                                            jets.const_data_ptr<T>(), out.mutable_data_ptr<T>()});
  });
  return out;
}

template <class Backend>
at::Tensor sample_indices(const at::Tensor& step, std::int64_t seed, std::int64_t stream,
                          std::int64_t count, std::int64_t population) {
  GRANPINN_CHECK_TYPE(step.scalar_type() == at::kLong && step.numel() == 1,
                      "step must be one int64 number, got ", shape_of(step));
  GRANPINN_CHECK_VALUE(count >= 0 && count < (1ll << 32), "count must be in 0..2^32 - 1, got ",
                       count);
  GRANPINN_CHECK_VALUE(population >= 1 && population < (1ll << 32),
                       "population must be in 1..2^32 - 1, got ", population);
  GRANPINN_CHECK_VALUE(stream >= 0 && stream < (1ll << 32), "stream must be in 0..2^32 - 1, got ",
                       stream);
  const c10::DeviceGuard guard(step.device());
  at::Tensor out = at::empty({count}, step.options());
  Backend::sample(step.const_data_ptr<std::int64_t>(), static_cast<std::uint64_t>(seed),
                  static_cast<std::uint32_t>(stream), count, static_cast<std::uint64_t>(population),
                  out.mutable_data_ptr<std::int64_t>());
  return out;
}

}  // namespace granpinn
