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

// Constants of a problem, all dimensionless (granpinn/physics/scales.py).
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

// mu(I) = mu_s + range ratio with ratio = I / (I0 + I) and rest = 1 - ratio, and I mu'(I).
template <class R>
struct FrictionJet {
  R range, over, ratio, rest, mu, I_dmu;
};

template <class R>
GRANPINN_HD FrictionJet<R> friction_jet(const R& I, const FrictionLaw<R>& law) {
  const R range = law.mu_2 - law.mu_s, over = R(scalar_t<R>(1)) / (law.I0 + I);
  const R ratio = I * over, rest = law.I0 * over;
  return {range, over, ratio, rest, law.mu_s + range * ratio, range * (ratio * rest)};
}

// The viscosity with its partial derivatives, zero where the clamp acts. Or adjoints of the three.
template <class R>
struct ViscosityJet {
  R eta, by_gamma_dot, by_p;
};

// What viscosity_jet and its adjoint are made of, without the clamp:
//   eta = mu p / gamma_dot,  I_gamma_dot = I / gamma_dot,  p I_p = -half I
// where half is 1/2 above the floor of p and 0 below.
template <class R, class T>
struct PlasticViscosity {
  FrictionJet<R> f;
  R over_gamma_dot, squared;  // 1 / gamma_dot, and its square
  R half, eta, by_gamma_dot, by_p;

  GRANPINN_HD PlasticViscosity(const R& gamma_dot, const R& p, const FrictionLaw<R>& law,
                               const Physics<T>& c)
      : f(friction_jet(inertial_number(gamma_dot, p, c), law)) {
    over_gamma_dot = R(T(1)) / gamma_dot;
    squared = over_gamma_dot * over_gamma_dot;
    half = select(less(R(c.pressure_floor), absolute(p)), R(T(0.5)), R(T(0)));
    eta = f.mu * p * over_gamma_dot;
    by_gamma_dot = (f.I_dmu - f.mu) * p * squared;
    by_p = (f.mu - half * f.I_dmu) * over_gamma_dot;
  }

  // `inside` between the limits of the clamp, `low` and `high` beyond them
  GRANPINN_HD R clamped(const R& inside, const R& low, const R& high, const Physics<T>& c) const {
    return select(less(eta, R(c.eta_min)), low, select(less(R(c.eta_max), eta), high, inside));
  }
};

template <class R, class T>
GRANPINN_HD ViscosityJet<R> viscosity_jet(const R& gamma_dot, const R& p, const FrictionLaw<R>& law,
                                          const Physics<T>& c) {
  const PlasticViscosity<R, T> v(gamma_dot, p, law, c);
  const R zero(T(0));
  return {v.clamped(v.eta, R(c.eta_min), R(c.eta_max), c), v.clamped(v.by_gamma_dot, zero, zero, c),
          v.clamped(v.by_p, zero, zero, c)};
}

// The adjoint of viscosity_jet: from `a`, those of its results, those of gamma_dot, p and the law.
template <class R, class T>
GRANPINN_HD void viscosity_jet_adjoint(const R& gamma_dot, const R& p, const FrictionLaw<R>& law,
                                       const Physics<T>& c, const ViscosityJet<R>& a,
                                       R& gamma_dot_a, R& p_a, R (&law_a)[3]) {
  const PlasticViscosity<R, T> v(gamma_dot, p, law, c);
  const FrictionJet<R>& f = v.f;
  // D = I mu'(I), and I D'(I)
  const R D = f.I_dmu, ID = D * (f.rest - f.ratio);
  // second derivatives of eta
  const R by_gg = ((ID - D) * p * v.squared - T(2) * v.by_gamma_dot) * v.over_gamma_dot;
  const R by_gp = (D - f.mu + v.half * (D - ID)) * v.squared;
  const R by_pp =
      select(less(R(T(0)), v.half), (T(0.25) * ID - T(0.5) * D) / p, R(T(0))) * v.over_gamma_dot;
  const R mu_a = (a.eta * p - a.by_gamma_dot * p * v.over_gamma_dot + a.by_p) * v.over_gamma_dot;
  const R D_a = a.by_gamma_dot * p * v.squared - v.half * a.by_p * v.over_gamma_dot;
  const auto inside = [&](const R& x) { return v.clamped(x, R(T(0)), R(T(0)), c); };
  gamma_dot_a = inside(a.eta * v.by_gamma_dot + a.by_gamma_dot * by_gg + a.by_p * by_gp);
  p_a = inside(a.eta * v.by_p + a.by_gamma_dot * by_gp + a.by_p * by_pp);
  law_a[0] = inside(f.rest * (mu_a - D_a * f.ratio));
  law_a[1] = inside(f.ratio * (mu_a + D_a * f.rest));
  law_a[2] = inside(-(f.range * f.ratio * f.over * (mu_a + D_a * (f.rest - f.ratio))));
}

}  // namespace granpinn
