// The strong form of the paper: momentum with the full divergence of 2 eta D, and continuity.
//   e_u = u_t + u u_x + v u_y + p_x - g_x
//         - [eta (2 u_xx + u_yy + v_xy) + 2 eta_x u_x + eta_y (u_y + v_x)]         (paper, eq. mom)
//   e_v = v_t + u v_x + v v_y + p_y - g_y
//         - [eta (v_xx + u_xy + 2 v_yy) + eta_x (u_y + v_x) + 2 eta_y v_y]
//   e_c = u_x + v_y                                                   (paper, eq. cont)
// with gamma_dot^2 = 2 D:D = 2 (u_x^2 + v_y^2) + (u_y + v_x)^2 and
// eta_x = eta_gamma_dot gamma_dot_x + eta_p p_x.
#pragma once

#include "fields.h"

namespace granpinn {

template <PressureMap map>
struct StrongForm {
  static constexpr int channels = 7;
  static constexpr int fields = 3;
  static constexpr int residuals = 3;
  static constexpr PressureMap pressure_map = map;

  template <class R, class T>
  static GRANPINN_HD void evaluate(const R (&z)[fields][channels], const FrictionLaw<R>& law,
                                   const Physics<T>& c, R (&e)[residuals]) {
    R u[channels], v[channels];
    for (int i = 0; i < channels; ++i) {
      u[i] = c.velocity_scale * z[0][i];
      v[i] = c.velocity_scale * z[1][i];
    }
    const PressureJet<R> p = pressure_jet<map>(z[2], c.pressure_scale);

    const R shear = u[kY] + v[kX];
    // the small constant keeps the square root differentiable in grains at rest
    const R gamma_dot =
        square_root(T(2) * (u[kX] * u[kX] + v[kY] * v[kY]) + shear * shear + T(1e-12));
    const R gamma_dot_x =
        (T(2) * (u[kX] * u[kXX] + v[kY] * v[kXY]) + shear * (u[kXY] + v[kXX])) / gamma_dot;
    const R gamma_dot_y =
        (T(2) * (u[kX] * u[kXY] + v[kY] * v[kYY]) + shear * (u[kYY] + v[kXY])) / gamma_dot;
    const ViscosityJet<R> eta = viscosity_jet(gamma_dot, p.p, law, c);
    const R eta_x = eta.by_gamma_dot * gamma_dot_x + eta.by_p * p.p_x;
    const R eta_y = eta.by_gamma_dot * gamma_dot_y + eta.by_p * p.p_y;

    const R stress_x =
        eta.eta * (T(2) * u[kXX] + u[kYY] + v[kXY]) + T(2) * (eta_x * u[kX]) + eta_y * shear;
    const R stress_y =
        eta.eta * (v[kXX] + u[kXY] + T(2) * v[kYY]) + eta_x * shear + T(2) * (eta_y * v[kY]);
    e[0] = u[kT] + u[kValue] * u[kX] + v[kValue] * u[kY] + p.p_x - stress_x - c.g_x;
    e[1] = v[kT] + u[kValue] * v[kX] + v[kValue] * v[kY] + p.p_y - stress_y - c.g_y;
    e[2] = u[kX] + v[kY];
  }
};

}  // namespace granpinn
