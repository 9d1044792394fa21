// The viscosity of a friction law, dimensionless with rho = 1:
//   eta = Y / gamma_dot with Y = mu(I) p, clamped to [eta_min, eta_max]   (paper, eq. eta)
// Cohesive laws add their cohesion to Y (cohesion.h).
// The paper prints max(eta, eta_max) for the clamp; that is a slip for min. eta_min is the floor
// that flow solvers use.
#pragma once

#include "cohesion.h"
#include "physics.h"

namespace granpinn {

// The viscosity with its partial derivatives, zero where the clamp acts; or their three adjoints.
template <class R>
struct ViscosityJet {
  R eta, by_gamma_dot, by_p;
};

// The quantities of viscosity_jet and its adjoint, without the clamp:
//   eta = Y / gamma_dot,  I_gamma_dot = I / gamma_dot,  p I_p = -half I
// where half is 1/2 above the floor of p and 0 below.
template <class Law, class R, class T>
struct PlasticViscosity {
  typename Law::template Jet<R> f;
  R over_gamma_dot, squared;  // 1 / gamma_dot, and its square
  R half, yield, eta, by_gamma_dot, by_p;

  template <int N>
  GRANPINN_HD PlasticViscosity(const R& gamma_dot, const R& p, const R (&theta)[N],
                               const Physics<T>& c)
      : f(inertial_number(gamma_dot, p, c), theta) {
    over_gamma_dot = R(T(1)) / gamma_dot;
    squared = over_gamma_dot * over_gamma_dot;
    half = select(less(R(c.pressure_floor), absolute(p)), R(T(0.5)), R(T(0)));
    yield = yield_stress<Law>(f.mu, p, theta);
    eta = yield * over_gamma_dot;
    by_gamma_dot = (f.I_dmu - f.mu) * p * squared;
    if constexpr (is_cohesive<Law>) by_gamma_dot = by_gamma_dot - theta[Law::cohesion] * squared;
    by_p = (f.mu - half * f.I_dmu) * over_gamma_dot;
  }

  // `inside` between the limits of the clamp, `low` and `high` beyond them
  GRANPINN_HD R clamped(const R& inside, const R& low, const R& high, const Physics<T>& c) const {
    return select(less(eta, R(c.eta_min)), low, select(less(R(c.eta_max), eta), high, inside));
  }
};

template <class Law, class R, class T, int N>
GRANPINN_HD ViscosityJet<R> viscosity_jet(const R& gamma_dot, const R& p, const R (&theta)[N],
                                          const Physics<T>& c) {
  const PlasticViscosity<Law, R, T> v(gamma_dot, p, theta, c);
  const R zero(T(0));
  return {v.clamped(v.eta, R(c.eta_min), R(c.eta_max), c), v.clamped(v.by_gamma_dot, zero, zero, c),
          v.clamped(v.by_p, zero, zero, c)};
}

// The adjoints of gamma_dot, p and theta from `a`, the adjoints of the results of viscosity_jet.
template <class Law, class R, class T, int N>
GRANPINN_HD void viscosity_jet_adjoint(const R& gamma_dot, const R& p, const R (&theta)[N],
                                       const Physics<T>& c, const ViscosityJet<R>& a,
                                       R& gamma_dot_a, R& p_a, R (&theta_a)[N]) {
  const PlasticViscosity<Law, R, T> v(gamma_dot, p, theta, c);
  // D = I mu'(I), and I D'(I)
  const R mu = v.f.mu, D = v.f.I_dmu, ID = v.f.I_d_I_dmu();
  // second derivatives of eta
  const R by_gg = ((ID - D) * p * v.squared - T(2) * v.by_gamma_dot) * v.over_gamma_dot;
  const R by_gp = (D - mu + v.half * (D - ID)) * v.squared;
  const R by_pp =
      select(less(R(T(0)), v.half), (T(0.25) * ID - T(0.5) * D) / p, R(T(0))) * v.over_gamma_dot;
  const R mu_a = (a.eta * p - a.by_gamma_dot * p * v.over_gamma_dot + a.by_p) * v.over_gamma_dot;
  const R D_a = a.by_gamma_dot * p * v.squared - v.half * a.by_p * v.over_gamma_dot;
  const auto inside = [&](const R& x) { return v.clamped(x, R(T(0)), R(T(0)), c); };
  gamma_dot_a = inside(a.eta * v.by_gamma_dot + a.by_gamma_dot * by_gg + a.by_p * by_gp);
  p_a = inside(a.eta * v.by_p + a.by_gamma_dot * by_gp + a.by_p * by_pp);
  v.f.adjoint(mu_a, D_a, theta_a);
  if constexpr (is_cohesive<Law>)
    theta_a[Law::cohesion] = (a.eta - a.by_gamma_dot * v.over_gamma_dot) * v.over_gamma_dot;
  for (int i = 0; i < Law::parameters; ++i) theta_a[i] = inside(theta_a[i]);
}

// For gamma_dot = 0 the quotient has no value; its limit is the clamp, and its derivatives are 0.
// NaN where an argument is NaN.
template <class Law, class R, class T, int N>
GRANPINN_HD R viscosity(const R& gamma_dot, const R& p, const R (&theta)[N], const Physics<T>& c) {
  const R zero(T(0));
  R held = p;  // positive where grains at rest hold a stress
  if constexpr (is_cohesive<Law>)
    held = yield_stress<Law>(typename Law::template Jet<R>(zero, theta).mu, p, theta);
  const R at_rest = select(less(zero, held), R(c.eta_max), R(c.eta_min));
  const R eta = viscosity_jet<Law>(gamma_dot, p, theta, c).eta;
  return select(less(zero, gamma_dot), eta, at_rest + (p + gamma_dot) * zero);
}

// The adjoints of gamma_dot, p and theta from eta_a, the adjoint of eta.
template <class Law, class R, class T, int N>
GRANPINN_HD void viscosity_adjoint(const R& gamma_dot, const R& p, const R (&theta)[N],
                                   const Physics<T>& c, const R& eta_a, R& gamma_dot_a, R& p_a,
                                   R (&theta_a)[N]) {
  const R zero(T(0)), one(T(1));
  const auto flows = less(zero, gamma_dot);
  const ViscosityJet<R> a{eta_a, zero, zero};
  viscosity_jet_adjoint<Law>(select(flows, gamma_dot, one), p, theta, c, a, gamma_dot_a, p_a,
                             theta_a);
  gamma_dot_a = select(flows, gamma_dot_a, zero);
  p_a = select(flows, p_a, zero);
  for (int i = 0; i < Law::parameters; ++i) theta_a[i] = select(flows, theta_a[i], zero);
}

}  // namespace granpinn
