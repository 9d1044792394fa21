// From the network's raw outputs z to the physical fields (dimensionless):
//   u = U z_0,  v = U z_1,  p = P z_2 or P softplus(z_2),  s_1 = z_3,  s_2 = z_4,
// with their first derivatives. softplus keeps p >= 0: grains carry no tension.
#pragma once

#include "body_force.h"
#include "jet.h"
#include "physics.h"
#include "terms.h"

namespace granpinn {

enum class PressureMap { linear, softplus };

template <PressureMap map, class R>
GRANPINN_HD R pressure_value(const R& z, scalar_t<R> scale) {
  using T = scalar_t<R>;
  if constexpr (map == PressureMap::linear) {
    return scale * z;
  } else {
    // softplus(z) = max(z, 0) + log(1 + exp(-|z|)): no overflow, no cancellation
    const R tail = log_one_plus(exponential(-absolute(z)));
    return scale * (maximum(z, R(T(0))) + tail);
  }
}

// dp/dz
template <PressureMap map, class R>
GRANPINN_HD R pressure_slope(const R& z, scalar_t<R> scale) {
  using T = scalar_t<R>;
  if constexpr (map == PressureMap::linear) {
    return R(scale);
  } else {
    // sigma(z) from exp(-|z|): exp(-z) would overflow where the pressure is nearly zero
    const R e = exponential(-absolute(z)), one(T(1));
    return scale * (select(less(z, R(T(0))), e, one) / (one + e));
  }
}

// p with its x and y derivatives
template <class R>
struct PressureJet {
  R p, p_x, p_y;
};

template <PressureMap map, int C, class R>
GRANPINN_HD PressureJet<R> pressure_jet(const R (&z)[C], scalar_t<R> scale) {
  const R slope = pressure_slope<map>(z[kValue], scale);
  return {pressure_value<map>(z[kValue], scale), slope * z[kX], slope * z[kY]};
}

// The adjoint: z_a of the raw jet z from a, the adjoints of p, p_x and p_y.
template <PressureMap map, int C, class R>
GRANPINN_HD void pressure_jet_adjoint(const R (&z)[C], scalar_t<R> scale, const PressureJet<R>& a,
                                      R (&z_a)[C]) {
  using T = scalar_t<R>;
  const R slope = pressure_slope<map>(z[kValue], scale);
  for (int i = 0; i < C; ++i) z_a[i] = R(T(0));
  z_a[kValue] = slope * a.p;
  z_a[kX] = slope * a.p_x;
  z_a[kY] = slope * a.p_y;
  if constexpr (map == PressureMap::softplus) {
    // sigma'(z), also from exp(-|z|)
    const R e = exponential(-absolute(z[kValue])), one(T(1));
    const R curvature = scale * e / ((one + e) * (one + e));
    z_a[kValue] = z_a[kValue] + curvature * (a.p_x * z[kX] + a.p_y * z[kY]);
  }
}

// The residuals of a form alone, without a source: the compiler leaves out the unused gradient.
template <class F, class Law, class R, class T, int N>
GRANPINN_HD void residuals_of(const R (&z)[F::fields][F::channels], const R (&theta)[N],
                              const Physics<T>& c, R (&e)[F::residuals]) {
  R w[F::residuals], z_a[F::fields][F::channels], theta_a[N];
  for (int r = 0; r < F::residuals; ++r) w[r] = R(T(0));
  const BodyForce<R> gravity{R(c.g_x), R(c.g_y)};
  F::template gradient<Law>(z, theta, c, gravity, w, e, z_a, theta_a);
}

}  // namespace granpinn
