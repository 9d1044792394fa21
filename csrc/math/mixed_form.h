// The mixed form: the stress is an unknown of its own, tau = p s, s = [[s_1, s_2], [s_2, -s_1]].
//   e_u = u_t + u u_x + v u_y + p_x - (p s_1)_x - (p s_2)_y - g_x
//   e_v = v_t + u v_x + v v_y + p_y - (p s_2)_x + (p s_1)_y - g_y
//   e_c = u_x + v_y
//   r   = gamma_dot s / mu(I) - 2 (D_1, D_2)
// The last line is the flow rule tau = mu(I) p 2 D / gamma_dot in complementarity form, divided by
// mu p: a difference of strain rates, so that its error is that of the measured strain rate, the
// same in fast and in slow grains. Rigid zones (gamma_dot -> 0) drop out by themselves: there is
// no division by gamma_dot, no viscosity and no clamp. D_1 = (u_x - v_y)/2, D_2 = (u_y + v_x)/2,
// gamma_dot = 2 sqrt(D_1^2 + D_2^2).
#pragma once

#include "fields.h"

namespace granpinn {

struct MixedForm {
  static constexpr int channels = 4;
  static constexpr int fields = 5;
  static constexpr int residuals = 5;
  static constexpr PressureMap pressure_map = PressureMap::softplus;

  template <class R, class T>
  static GRANPINN_HD void evaluate(const R (&z)[fields][channels], const FrictionLaw<R>& law,
                                   const Physics<T>& c, R (&e)[residuals]) {
    R u[channels], v[channels];
    for (int i = 0; i < channels; ++i) {
      u[i] = c.velocity_scale * z[0][i];
      v[i] = c.velocity_scale * z[1][i];
    }
    const PressureJet<R> p = pressure_jet<pressure_map>(z[2], c.pressure_scale);
    const R(&s1)[channels] = z[3];
    const R(&s2)[channels] = z[4];

    const R stress_x = p.p_x * s1[kValue] + p.p * s1[kX] + p.p_y * s2[kValue] + p.p * s2[kY];
    const R stress_y = p.p_x * s2[kValue] + p.p * s2[kX] - p.p_y * s1[kValue] - p.p * s1[kY];
    e[0] = u[kT] + u[kValue] * u[kX] + v[kValue] * u[kY] + p.p_x - stress_x - c.g_x;
    e[1] = v[kT] + u[kValue] * v[kX] + v[kValue] * v[kY] + p.p_y - stress_y - c.g_y;
    e[2] = u[kX] + v[kY];

    const R two_D1 = u[kX] - v[kY], two_D2 = u[kY] + v[kX];
    const R gamma_dot = square_root(two_D1 * two_D1 + two_D2 * two_D2 + T(1e-12));
    const R mu = friction(inertial_number(gamma_dot, p.p, c), law);
    const R rate = gamma_dot / mu;
    e[3] = rate * s1[kValue] - two_D1;
    e[4] = rate * s2[kValue] - two_D2;
  }
};

}  // namespace granpinn
