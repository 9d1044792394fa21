// The mixed form: the stress is an unknown of its own, tau = p s, s = [[s_1, s_2], [s_2, -s_1]].
//   e_u = u_t + u u_x + v u_y + p_x - (p s_1)_x - (p s_2)_y - f_x + k p u / |v|
//   e_v = v_t + u v_x + v v_y + p_y - (p s_2)_x + (p s_1)_y - f_y + k p v / |v|
//   e_c = u_x + v_y
//   r   = w [gamma_dot s / mu(I) - 2 (D_1, D_2)],  w^-2 = 1 + (gamma_dot / c)^2
// The last line is the flow rule tau = mu(I) p 2 D / gamma_dot in complementarity form, divided by
// mu p. It is a difference of strain rates. So it has the error of the measured strain rate, which
// is the same in fast and in slow grains. Rigid zones (gamma_dot -> 0) drop out by themselves: no
// division by gamma_dot, no viscosity and no clamp. Above the shear rate c it is a relative error,
// so that a law that errs by some per cent in fast grains does not outweigh slow ones.
// D_1 = (u_x - v_y)/2, D_2 = (u_y + v_x)/2, gamma_dot = 2 sqrt(D_1^2 + D_2^2).
// f is gravity and the source term, if there is one (body_force.h). k p v / |v| is the friction of
// side walls (side_walls.h).
// Cohesive grains (cohesion.h) have the yield stress Y = c + mu(I) p in the place of mu(I) p, so
// that r = w [gamma_dot s p / Y - 2 (D_1, D_2)]. tau = p s still holds, so that the free surface
// has no traction. There |s| = mu + c / p grows without bound, which no network gives, and
// r = -2 w (D_1, D_2) demands rest. r is finite. So a c that is found is too small, and its mu_s
// too large; grains without cohesion have c = 0. With tau = (p + c / mu_s) s, |s| is bounded, but c
// takes a traction on the surface for granted: trials on simulated collapses then found a c where
// there is none.
#pragma once

#include "../body_force.h"
#include "../cohesion.h"
#include "../fields.h"
#include "../side_walls.h"

namespace granpinn {

struct MixedForm {
  static constexpr int channels = 4;
  static constexpr int fields = 5;
  static constexpr int residuals = 5;
  static constexpr PressureMap pressure_map = PressureMap::softplus;

  // The loss term of a residual.
  static GRANPINN_HD constexpr Term term_of(int residual) {
    return residual < 2 ? kMomentum : residual == 2 ? kContinuity : kConstitutive;
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
    const R(&s1)[channels] = z[3];
    const R(&s2)[channels] = z[4];

    const R stress_x = p.p_x * s1[kValue] + p.p * s1[kX] + p.p_y * s2[kValue] + p.p * s2[kY];
    const R stress_y = p.p_x * s2[kValue] + p.p * s2[kX] - p.p_y * s1[kValue] - p.p * s1[kY];
    e[0] = u[kT] + u[kValue] * u[kX] + v[kValue] * u[kY] + p.p_x - stress_x - force.x;
    e[1] = v[kT] + u[kValue] * v[kX] + v[kValue] * v[kY] + p.p_y - stress_y - force.y;
    subtract_side_walls(u[kValue], v[kValue], p.p, c, e);
    e[2] = u[kX] + v[kY];

    const R two_D1 = u[kX] - v[kY], two_D2 = u[kY] + v[kX];
    const R gamma_dot = square_root(two_D1 * two_D1 + two_D2 * two_D2 + T(1e-12));
    const R I = inertial_number(gamma_dot, p.p, c);
    const typename Law::template Jet<R> f(I, theta);
    const OverFriction<Law, R> over(f.mu, p.p, theta);
    const R rate = gamma_dot * over.mu;
    const R over_law_rate = R(T(1) / c.law_rate), fast = gamma_dot * over_law_rate;
    const R limit = R(T(1)) / square_root(R(T(1)) + fast * fast);
    e[3] = limit * (rate * s1[kValue] - two_D1);
    e[4] = limit * (rate * s2[kValue] - two_D2);

    R a[residuals];
    for (int r = 0; r < residuals; ++r) a[r] = w[r] * e[r];
    const R limit_a = a[3] * e[3] + a[4] * e[4];  // limit times its adjoint
    a[3] = limit * a[3];
    a[4] = limit * a[4];
    const R rate_a = a[3] * s1[kValue] + a[4] * s2[kValue];
    const R mu_a = -(rate_a * rate * over.mu);
    f.adjoint(mu_a, theta_a);
    const R I_I_a = mu_a * f.I_dmu;  // I times its adjoint
    const R by_limit = limit * over_law_rate;
    const R over_gamma_dot =
        (rate_a * rate + I_I_a) / (gamma_dot * gamma_dot) - limit_a * by_limit * by_limit;
    const R two_D1_a = over_gamma_dot * two_D1 - a[3], two_D2_a = over_gamma_dot * two_D2 - a[4];
    const auto above_floor = less(R(c.pressure_floor), absolute(p.p));
    const R by_I = select(above_floor, T(0.5) * I_I_a / p.p, R(T(0)));

    z_a[0][kValue] = a[0] * u[kX] + a[1] * v[kX];
    z_a[0][kX] = a[0] * u[kValue] + a[2] + two_D1_a;
    z_a[0][kY] = a[0] * v[kValue] + two_D2_a;
    z_a[0][kT] = a[0];
    z_a[1][kValue] = a[0] * u[kY] + a[1] * v[kY];
    z_a[1][kX] = a[1] * u[kValue] + two_D2_a;
    z_a[1][kY] = a[1] * v[kValue] + a[2] - two_D1_a;
    z_a[1][kT] = a[1];
    PressureJet<R> p_a{
        -(a[0] * (s1[kX] + s2[kY]) + a[1] * (s2[kX] - s1[kY]) + by_I),
        a[0] - (a[0] * s1[kValue] + a[1] * s2[kValue]),
        a[1] - (a[0] * s2[kValue] - a[1] * s1[kValue]),
    };
    if constexpr (is_cohesive<Law>) {
      // rate = gamma_dot p / Y, and Y = c + mu p
      const R over_Y_a = rate_a * over.yield;
      theta_a[Law::cohesion] = -(over_Y_a * rate);
      p_a.p = p_a.p + over_Y_a * gamma_dot * (theta[Law::cohesion] * over.yield);
    }
    add_side_walls_adjoint(u[kValue], v[kValue], p.p, c, a[0], a[1], z_a[0][kValue], z_a[1][kValue],
                           p_a.p);
    for (int i = 0; i < channels; ++i) {
      z_a[0][i] = c.velocity_scale * z_a[0][i];
      z_a[1][i] = c.scale_of(1) * z_a[1][i];
    }
    pressure_jet_adjoint<pressure_map>(z[2], c.pressure_scale, p_a, z_a[2]);
    z_a[3][kValue] = a[3] * rate - (a[0] * p.p_x - a[1] * p.p_y);
    z_a[3][kX] = -(a[0] * p.p);
    z_a[3][kY] = a[1] * p.p;
    z_a[4][kValue] = a[4] * rate - (a[0] * p.p_y + a[1] * p.p_x);
    z_a[4][kX] = -(a[1] * p.p);
    z_a[4][kY] = -(a[0] * p.p);
    z_a[3][kT] = z_a[4][kT] = R(T(0));
  }
};

}  // namespace granpinn
