// The mu(I) rheology (Jop, Forterre, Pouliquen 2006), dimensionless with rho = 1:
//   I = d gamma_dot / sqrt(|p|)                          (paper, eq. I)
//   mu(I) = mu_s + (mu_2 - mu_s) / (1 + I0 / I)          (paper, eq. muI)
//   eta = mu(I) p / gamma_dot, clamped to [eta_min, eta_max]   (paper, eq. eta)
// The paper prints max(eta, eta_max) for the clamp; that is a slip for min. eta_min is the floor
// that flow solvers use.
#pragma once

#include "scalar.h"

namespace granpinn {

template <class R>
struct FrictionLaw {
  R mu_s, mu_2, I0;
};

// Constants of a problem, all dimensionless (granpinn/scales.py).
template <class T>
struct Physics {
  T grain_diameter;
  T g_x, g_y;
  T eta_min, eta_max;
  T velocity_scale, pressure_scale;  // of the network's raw outputs
  T pressure_floor;                  // under the root of I
};

constexpr int kPhysics = 8;

// From the list of the operators: [d, g_x, g_y, eta_min, eta_max, U_out, P_out, p_floor].
template <class T, class From>
GRANPINN_HD Physics<T> physics_from(const From* a) {
  return {T(a[0]), T(a[1]), T(a[2]), T(a[3]), T(a[4]), T(a[5]), T(a[6]), T(a[7])};
}

template <class R, class T>
GRANPINN_HD R inertial_number(const R& gamma_dot, const R& p, const Physics<T>& c) {
  const R floored = maximum(absolute(p), R(c.pressure_floor));
  return c.grain_diameter * gamma_dot / square_root(floored);
}

template <class R>
GRANPINN_HD R friction(const R& I, const FrictionLaw<R>& law) {
  return law.mu_s + (law.mu_2 - law.mu_s) * (I / (law.I0 + I));
}

template <class R, class T>
GRANPINN_HD R viscosity(const R& gamma_dot, const R& p, const FrictionLaw<R>& law,
                        const Physics<T>& c) {
  const R zero(T(0)), lowest(c.eta_min), highest(c.eta_max);
  const R eta = friction(inertial_number(gamma_dot, p, c), law) * p / gamma_dot;
  // at rest the quotient has no value; its limit is the clamp
  const R at_rest = select(less(zero, p), highest, lowest);
  return select(less(zero, gamma_dot), minimum(maximum(eta, lowest), highest), at_rest);
}

// The viscosity with its partial derivatives, zero where the clamp acts.
template <class R>
struct ViscosityJet {
  R eta, by_gamma_dot, by_p;
};

template <class R, class T>
GRANPINN_HD ViscosityJet<R> viscosity_jet(const R& gamma_dot, const R& p, const FrictionLaw<R>& law,
                                          const Physics<T>& c) {
  const R zero(T(0));
  const R I = inertial_number(gamma_dot, p, c);
  const R ratio = I / (law.I0 + I);
  const R mu = law.mu_s + (law.mu_2 - law.mu_s) * ratio;
  // I mu'(I) = (mu_2 - mu_s) I0 I / (I0 + I)^2;  I_gamma_dot = I / gamma_dot;  p I_p = -I / 2
  const R I_dmu = (law.mu_2 - law.mu_s) * (ratio * (law.I0 / (law.I0 + I)));
  const R over_gamma_dot = T(1) / gamma_dot;
  const R eta = mu * p * over_gamma_dot;
  const auto above_floor = less(R(c.pressure_floor), absolute(p));
  const R half_I_dmu = select(above_floor, T(0.5) * I_dmu, zero);
  const auto low = less(eta, R(c.eta_min));
  const auto high = less(R(c.eta_max), eta);
  const R by_gamma_dot = (I_dmu - mu) * p * (over_gamma_dot * over_gamma_dot);
  const R by_p = (mu - half_I_dmu) * over_gamma_dot;
  ViscosityJet<R> out;
  out.eta = select(low, R(c.eta_min), select(high, R(c.eta_max), eta));
  out.by_gamma_dot = select(low, zero, select(high, zero, by_gamma_dot));
  out.by_p = select(low, zero, select(high, zero, by_p));
  return out;
}

}  // namespace granpinn
