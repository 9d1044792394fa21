// The strong form of the paper: momentum with the full divergence of 2 eta D, and continuity.
//   e_u = u_t + u u_x + v u_y + p_x - f_x + k p u / |v|
//         - [eta (2 u_xx + u_yy + v_xy) + 2 eta_x u_x + eta_y (u_y + v_x)]         (paper, eq. mom)
//   e_v = v_t + u v_x + v v_y + p_y - f_y + k p v / |v|
//         - [eta (v_xx + u_xy + 2 v_yy) + eta_x (u_y + v_x) + 2 eta_y v_y]
//   e_c = u_x + v_y                                                   (paper, eq. cont)
// with gamma_dot^2 = 2 D:D = 2 (u_x^2 + v_y^2) + (u_y + v_x)^2 and
// eta_x = eta_gamma_dot gamma_dot_x + eta_p p_x. f is gravity and the source term, if there is one
// (body_force.h). k p v / |v| is the friction of side walls (side_walls.h). The paper has neither
// source nor side walls.
#pragma once

#include "../body_force.h"
#include "../fields.h"
#include "../side_walls.h"
#include "../viscosity.h"

namespace granpinn {

template <PressureMap map>
struct StrongForm {
  static constexpr int channels = 7;
  static constexpr int fields = 3;
  static constexpr int residuals = 3;
  static constexpr PressureMap pressure_map = map;

  // The loss term of a residual.
  static GRANPINN_HD constexpr Term term_of(int residual) {
    return residual < 2 ? kMomentum : kContinuity;
  }

  // From raw jets z, the body force and weights w, one per residual: the residuals e, and the
  // gradient z_a, theta_a of sum_r w_r e_r^2 / 2, in reverse mode. A name that ends in _a is an
  // adjoint.
  template <class Law, class R, class T, int N>
  static GRANPINN_HD void gradient(const R (&z)[fields][channels], const R (&theta)[N],
                                   const Physics<T>& c, const BodyForce<R>& force,
                                   const R (&w)[residuals], R (&e)[residuals],
                                   R (&z_a)[fields][channels], R (&theta_a)[N]) {
    R u[channels], v[channels];
    for (int i = 0; i < channels; ++i) {
      u[i] = c.velocity_scale * z[0][i];
      v[i] = c.scale_of(1) * z[1][i];
    }
    const PressureJet<R> p = pressure_jet<pressure_map>(z[2], c.pressure_scale);

    const R shear = u[kY] + v[kX], shear_x = u[kXY] + v[kXX], shear_y = u[kYY] + v[kXY];
    // the small constant keeps the square root differentiable in grains at rest
    const R gamma_dot =
        square_root(T(2) * (u[kX] * u[kX] + v[kY] * v[kY]) + shear * shear + T(1e-12));
    const R over = R(T(1)) / gamma_dot;
    const R gamma_dot_x = (T(2) * (u[kX] * u[kXX] + v[kY] * v[kXY]) + shear * shear_x) * over;
    const R gamma_dot_y = (T(2) * (u[kX] * u[kXY] + v[kY] * v[kYY]) + shear * shear_y) * over;
    const ViscosityJet<R> eta = viscosity_jet<Law>(gamma_dot, p.p, theta, c);
    const R eta_x = eta.by_gamma_dot * gamma_dot_x + eta.by_p * p.p_x;
    const R eta_y = eta.by_gamma_dot * gamma_dot_y + eta.by_p * p.p_y;

    const R bend_x = T(2) * u[kXX] + u[kYY] + v[kXY], bend_y = v[kXX] + u[kXY] + T(2) * v[kYY];
    const R stress_x = eta.eta * bend_x + T(2) * (eta_x * u[kX]) + eta_y * shear;
    const R stress_y = eta.eta * bend_y + eta_x * shear + T(2) * (eta_y * v[kY]);
    e[0] = u[kT] + u[kValue] * u[kX] + v[kValue] * u[kY] + p.p_x - stress_x - force.x;
    e[1] = v[kT] + u[kValue] * v[kX] + v[kValue] * v[kY] + p.p_y - stress_y - force.y;
    subtract_side_walls(u[kValue], v[kValue], p.p, c, e);
    e[2] = u[kX] + v[kY];

    const R a0 = w[0] * e[0], a1 = w[1] * e[1], a2 = w[2] * e[2];
    const R eta_x_a = -(T(2) * a0 * u[kX] + a1 * shear);
    const R eta_y_a = -(a0 * shear + T(2) * a1 * v[kY]);
    const ViscosityJet<R> eta_a{-(a0 * bend_x + a1 * bend_y),
                                eta_x_a * gamma_dot_x + eta_y_a * gamma_dot_y,
                                eta_x_a * p.p_x + eta_y_a * p.p_y};
    R gamma_dot_a, p_a;
    viscosity_jet_adjoint<Law>(gamma_dot, p.p, theta, c, eta_a, gamma_dot_a, p_a, theta_a);
    // of the numerators of gamma_dot_x and gamma_dot_y, and of gamma_dot^2 / 2
    const R X = eta_x_a * eta.by_gamma_dot * over, Y = eta_y_a * eta.by_gamma_dot * over;
    const R G = (gamma_dot_a - (X * gamma_dot_x + Y * gamma_dot_y)) * over;
    const R shear_a = G * shear + X * shear_x + Y * shear_y - (a0 * eta_y + a1 * eta_x);
    const R bend_x_a = a0 * eta.eta, bend_y_a = a1 * eta.eta;  // with the other sign

    z_a[0][kValue] = a0 * u[kX] + a1 * v[kX];
    z_a[1][kValue] = a0 * u[kY] + a1 * v[kY];
    z_a[0][kX] = a0 * u[kValue] + a2 + T(2) * (G * u[kX] + X * u[kXX] + Y * u[kXY] - a0 * eta_x);
    z_a[1][kY] = a1 * v[kValue] + a2 + T(2) * (G * v[kY] + X * v[kXY] + Y * v[kYY] - a1 * eta_y);
    z_a[0][kY] = a0 * v[kValue] + shear_a;
    z_a[1][kX] = a1 * u[kValue] + shear_a;
    z_a[0][kT] = a0;
    z_a[1][kT] = a1;
    z_a[0][kXX] = T(2) * (X * u[kX] - bend_x_a);
    z_a[0][kXY] = T(2) * (Y * u[kX]) + X * shear - bend_y_a;
    z_a[0][kYY] = Y * shear - bend_x_a;
    z_a[1][kXX] = X * shear - bend_y_a;
    z_a[1][kXY] = T(2) * (X * v[kY]) + Y * shear - bend_x_a;
    z_a[1][kYY] = T(2) * (Y * v[kY] - bend_y_a);
    add_side_walls_adjoint(u[kValue], v[kValue], p.p, c, a0, a1, z_a[0][kValue], z_a[1][kValue],
                           p_a);
    for (int i = 0; i < channels; ++i) {
      z_a[0][i] = c.velocity_scale * z_a[0][i];
      z_a[1][i] = c.scale_of(1) * z_a[1][i];
    }
    const PressureJet<R> pressure_a{p_a, a0 + eta_x_a * eta.by_p, a1 + eta_y_a * eta.by_p};
    pressure_jet_adjoint<pressure_map>(z[2], c.pressure_scale, pressure_a, z_a[2]);
  }
};

}  // namespace granpinn
