// Checks of the operators that act point by point. Shared by all devices.
#pragma once

#include "arguments.h"

namespace granpinn {

template <class T>
Physics<T> rheology_constants(double d, double eta_min, double eta_max, double p_floor) {
  Physics<T> c{};
  c.grain_diameter = static_cast<T>(d);
  c.eta_min = static_cast<T>(eta_min);
  c.eta_max = static_cast<T>(eta_max);
  c.pressure_floor = static_cast<T>(p_floor);
  return c;
}

inline void check_viscosity(const at::Tensor& gamma_dot, const at::Tensor& p,
                            const at::Tensor& theta) {
  GRANPINN_CHECK_TYPE(
      gamma_dot.scalar_type() == at::kFloat || gamma_dot.scalar_type() == at::kDouble,
      "gamma_dot must be float32 or float64, got ", shape_of(gamma_dot));
  GRANPINN_CHECK_VALUE(gamma_dot.dim() == 1, "gamma_dot must be [N], got ", shape_of(gamma_dot));
  shared("p", p, gamma_dot, 0, {gamma_dot.size(0)});
  shared("theta", theta, gamma_dot, 0, {3});
}

// Checks raw jets [C, N, K] of a form, and theta.
inline Form check_jets(const at::Tensor& raw_jets, const at::Tensor& theta, c10::string_view form) {
  const Form kind = form_of(form);
  const bool mixed = kind == Form::mixed;
  GRANPINN_CHECK_VALUE(kind != Form::data, "form must be 'mixed' or 'strong', got '", form, "'");
  GRANPINN_CHECK_TYPE(raw_jets.scalar_type() == at::kFloat || raw_jets.scalar_type() == at::kDouble,
                      "raw_jets must be float32 or float64, got ", shape_of(raw_jets));
  const std::int64_t K = raw_jets.dim() == 3 ? raw_jets.size(2) : 0;
  GRANPINN_CHECK_VALUE(
      raw_jets.dim() == 3 && raw_jets.size(0) == (mixed ? 4 : 7) && (K == 5 || (K == 3 && !mixed)),
      "raw_jets must be ", mixed ? "[4, N, 5]" : "[7, N, 3 or 5]", " for the ", form, " form, got ",
      shape_of(raw_jets));
  shared("theta", theta, raw_jets, 0, {3});
  return kind;
}

inline void check_sampling(const at::Tensor& step, std::int64_t count, std::int64_t population) {
  GRANPINN_CHECK_TYPE(step.scalar_type() == at::kLong && step.numel() == 1,
                      "step must be one int64 number, got ", shape_of(step));
  GRANPINN_CHECK_VALUE(count >= 0 && count < (1ll << 32), "count must be in 0..2^32 - 1, got ",
                       count);
  GRANPINN_CHECK_VALUE(population >= 1 && population < (1ll << 32),
                       "population must be in 1..2^32 - 1, got ", population);
}

}  // namespace granpinn
