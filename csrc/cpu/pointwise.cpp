// The operators that act point by point, on the CPU.
#include "math/philox.h"
#include "ops.h"
#include "threads.h"

namespace granpinn {

namespace {

template <class T>
Physics<T> rheology_constants(double d, double eta_min, double eta_max, double p_floor) {
  Physics<T> c{};
  c.grain_diameter = static_cast<T>(d);
  c.eta_min = static_cast<T>(eta_min);
  c.eta_max = static_cast<T>(eta_max);
  c.pressure_floor = static_cast<T>(p_floor);
  return c;
}

void check_viscosity(const at::Tensor& gamma_dot, const at::Tensor& p, const at::Tensor& theta) {
  TORCH_CHECK_TYPE(gamma_dot.scalar_type() == at::kFloat || gamma_dot.scalar_type() == at::kDouble,
                   "gamma_dot must be float32 or float64, got ", shape_of(gamma_dot));
  TORCH_CHECK_VALUE(gamma_dot.dim() == 1, "gamma_dot must be [N], got ", shape_of(gamma_dot));
  shared("p", p, gamma_dot, 0, {gamma_dot.size(0)});
  shared("theta", theta, gamma_dot, 0, {3});
}

}  // namespace

at::Tensor viscosity_cpu(const at::Tensor& gamma_dot, const at::Tensor& p, const at::Tensor& theta,
                         double d, double eta_min, double eta_max, double p_floor) {
  check_viscosity(gamma_dot, p, theta);
  const at::Tensor rate = gamma_dot.contiguous(), pressure = p.contiguous();
  const at::Tensor law = theta.contiguous();
  at::Tensor eta = at::empty_like(rate);
  AT_DISPATCH_FLOATING_TYPES(rate.scalar_type(), "viscosity", [&] {
    kernels<scalar_t>().viscosity(rheology_constants<scalar_t>(d, eta_min, eta_max, p_floor),
                                  law.const_data_ptr<scalar_t>(), rate.const_data_ptr<scalar_t>(),
                                  pressure.const_data_ptr<scalar_t>(), rate.size(0),
                                  eta.mutable_data_ptr<scalar_t>(), nullptr);
  });
  return eta;
}

// (d eta / d gamma_dot, d eta / d p, d eta / d theta) applied to grad: [N], [N], [3].
std::tuple<at::Tensor, at::Tensor, at::Tensor> viscosity_backward_cpu(
    const at::Tensor& grad, const at::Tensor& gamma_dot, const at::Tensor& p,
    const at::Tensor& theta, double d, double eta_min, double eta_max, double p_floor) {
  check_viscosity(gamma_dot, p, theta);
  const at::Tensor rate = gamma_dot.contiguous(), pressure = p.contiguous();
  const at::Tensor law = theta.contiguous();
  at::Tensor derivatives = at::empty({rate.size(0), 5}, rate.options());
  AT_DISPATCH_FLOATING_TYPES(rate.scalar_type(), "viscosity_backward", [&] {
    kernels<scalar_t>().viscosity(rheology_constants<scalar_t>(d, eta_min, eta_max, p_floor),
                                  law.const_data_ptr<scalar_t>(), rate.const_data_ptr<scalar_t>(),
                                  pressure.const_data_ptr<scalar_t>(), rate.size(0), nullptr,
                                  derivatives.mutable_data_ptr<scalar_t>());
  });
  const at::Tensor scaled = derivatives * grad.unsqueeze(1);
  return {scaled.select(1, 0).contiguous(), scaled.select(1, 1).contiguous(),
          scaled.slice(1, 2).sum(0)};
}

at::Tensor pointwise_residuals_cpu(const at::Tensor& raw_jets, const at::Tensor& theta,
                                   Doubles physics, c10::string_view form) {
  const Form kind = form_of(form);
  const bool mixed = kind == Form::mixed;
  TORCH_CHECK_VALUE(kind != Form::data, "form must be 'mixed' or 'strong', got '", form, "'");
  TORCH_CHECK_TYPE(raw_jets.scalar_type() == at::kFloat || raw_jets.scalar_type() == at::kDouble,
                   "raw_jets must be float32 or float64, got ", shape_of(raw_jets));
  const std::int64_t K = raw_jets.dim() == 3 ? raw_jets.size(2) : 0;
  TORCH_CHECK_VALUE(
      raw_jets.dim() == 3 && raw_jets.size(0) == (mixed ? 4 : 7) && (K == 5 || (K == 3 && !mixed)),
      "raw_jets must be ", mixed ? "[4, N, 5]" : "[7, N, 3 or 5]", " for the ", form, " form, got ",
      shape_of(raw_jets));
  shared("theta", theta, raw_jets, 0, {3});
  const at::Tensor jets = raw_jets.contiguous(), law = theta.contiguous();
  at::Tensor out = at::empty({jets.size(1), mixed ? 5 : 3}, jets.options());
  AT_DISPATCH_FLOATING_TYPES(jets.scalar_type(), "pointwise_residuals", [&] {
    kernels<scalar_t>().residuals(kind, K == 5, physics_of<scalar_t>(physics),
                                  law.const_data_ptr<scalar_t>(), jets.const_data_ptr<scalar_t>(),
                                  jets.size(1), K, out.mutable_data_ptr<scalar_t>());
  });
  return out;
}

at::Tensor sample_indices_cpu(const at::Tensor& step, std::int64_t seed, std::int64_t stream,
                              std::int64_t count, std::int64_t population) {
  TORCH_CHECK_TYPE(step.scalar_type() == at::kLong && step.numel() == 1,
                   "step must be one int64 number, got ", shape_of(step));
  TORCH_CHECK_VALUE(count >= 0 && count < (1ll << 32), "count must be in 0..2^32 - 1, got ", count);
  TORCH_CHECK_VALUE(population >= 1 && population < (1ll << 32),
                    "population must be in 1..2^32 - 1, got ", population);
  at::Tensor out = at::empty({count}, step.options());
  std::int64_t* to = out.mutable_data_ptr<std::int64_t>();
  const auto now = static_cast<std::uint64_t>(*step.const_data_ptr<std::int64_t>());
  for (std::int64_t i = 0; i < count; ++i)
    to[i] = sample_index(static_cast<std::uint64_t>(seed), now, static_cast<std::uint32_t>(stream),
                         static_cast<std::uint32_t>(i), static_cast<std::uint64_t>(population));
  return out;
}

}  // namespace granpinn
