// Kernels that act point by point: residuals from raw jets, the viscosity and its adjoint.
#pragma once

#include "math/forms/mixed.h"
#include "math/forms/strong.h"
#include "math/viscosity.h"
#include "problem.h"
#include "simd.h"

namespace granpinn {
namespace GRANPINN_SIMD_NAMESPACE {

// The parameters of a law in every lane.
template <class Law, class T>
struct LawValues {
  Vec<T> theta[Law::parameters];

  explicit LawValues(const T* from) {
    for (int i = 0; i < Law::parameters; ++i) theta[i] = Vec<T>(from[i]);
  }
};

template <class F, class Law, class T>
void form_residuals(const ResidualArguments<T>& a) {
  using V = Vec<T>;
  const LawValues<Law, T> law(a.theta);
  for (std::int64_t at = 0; at < a.n; at += kLanes<T>) {
    V z[F::fields][F::channels], e[F::residuals];
    const std::int64_t count = a.n - at < kLanes<T> ? a.n - at : kLanes<T>;
    for (int k = 0; k < F::fields; ++k)
      for (int c = 0; c < F::channels; ++c)
        for (int p = 0; p < kLanes<T>; ++p)
          z[k][c].v[p] = a.jets[(c * a.n + at + (p < count ? p : count - 1)) * a.fields + k];
    residuals_of<F, Law>(z, law.theta, a.physics, e);
    for (std::int64_t p = 0; p < count; ++p)
      for (int r = 0; r < F::residuals; ++r) a.out[(at + p) * F::residuals + r] = e[r].v[p];
  }
}

static_assert(channels_of(Form::mixed) == MixedForm::channels &&
              residuals_of_form(Form::mixed) == MixedForm::residuals);
using Strong = StrongForm<PressureMap::linear>;
static_assert(channels_of(Form::strong) == Strong::channels &&
              residuals_of_form(Form::strong) == Strong::residuals);

template <class T>
void residuals(const ResidualArguments<T>& a) {
  visit_law(a.law, [&](auto law) {
    using Law = decltype(law);
    if (a.form == Form::mixed)
      form_residuals<MixedForm, Law>(a);
    else if (a.softplus)
      form_residuals<StrongForm<PressureMap::softplus>, Law>(a);
    else
      form_residuals<StrongForm<PressureMap::linear>, Law>(a);
  });
}

// `count` values from `at` on, the last one again behind them.
template <class T>
Vec<T> load_lanes(const T* from, std::int64_t at, std::int64_t count) {
  Vec<T> out;
  for (int i = 0; i < kLanes<T>; ++i) out.v[i] = from[at + (i < count ? i : count - 1)];
  return out;
}

// Calls work(law, its values, at, count) for the lanes from `at` on.
template <class T, class Work>
void each_viscosity(const ViscosityArguments<T>& a, const Work& work) {
  visit_law(a.law, [&](auto law) {
    const LawValues<decltype(law), T> values(a.theta);
    for (std::int64_t at = 0; at < a.n; at += kLanes<T>)
      work(law, values.theta, at, a.n - at < kLanes<T> ? a.n - at : std::int64_t{kLanes<T>});
  });
}

template <class T>
void viscosity_values(const ViscosityArguments<T>& a) {
  each_viscosity(a, [&](auto law, const auto& theta, std::int64_t at, std::int64_t count) {
    const Vec<T> eta = viscosity<decltype(law)>(load_lanes(a.gamma_dot, at, count),
                                                load_lanes(a.p, at, count), theta, a.physics);
    for (std::int64_t i = 0; i < count; ++i) a.eta[at + i] = eta.v[i];
  });
}

template <class T>
void viscosity_gradient(const ViscosityArguments<T>& a) {
  each_viscosity(a, [&](auto law, const auto& theta, std::int64_t at, std::int64_t count) {
    using Law = decltype(law);
    Vec<T> by_gamma_dot, by_p, by_theta[Law::parameters];
    viscosity_adjoint<Law>(load_lanes(a.gamma_dot, at, count), load_lanes(a.p, at, count), theta,
                           a.physics, load_lanes(a.grad, at, count), by_gamma_dot, by_p, by_theta);
    for (std::int64_t i = 0; i < count; ++i) {
      a.grad_gamma_dot[at + i] = by_gamma_dot.v[i];
      a.grad_p[at + i] = by_p.v[i];
      for (int k = 0; k < Law::parameters; ++k)
        a.grad_theta[(at + i) * Law::parameters + k] = by_theta[k].v[i];
    }
  });
}

}  // namespace GRANPINN_SIMD_NAMESPACE
}  // namespace granpinn
