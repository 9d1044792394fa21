// Friction of the two side walls of a narrow channel, as a body force against the velocity:
//   f = -k p v / |v|,  |v|^2 = u^2 + v^2 + s^2,  k = 2 mu_w / W
// for a gap W between the walls and rho = 1 (Jop, Forterre & Pouliquen 2005, J. Fluid Mech. 541).
// The small speed s is a deviation: grains at rest feel any force up to k p, and s makes the force
// differentiable there. Without side walls, k = 0 and nothing is computed.
#pragma once

#include "physics.h"

namespace granpinn {

// Direction of the velocity, v / |v|, and 1 / |v|.
template <class R>
struct Sliding {
  R along_x, along_y, over_speed;
};

template <class R, class T>
GRANPINN_HD Sliding<R> sliding(const R& u, const R& v, const Physics<T>& c) {
  const R smallest(c.side_wall_speed * c.side_wall_speed);
  const R over = R(T(1)) / square_root(u * u + v * v + smallest);
  return {u * over, v * over, over};
}

// Subtracts the force from the residuals e[0] and e[1] of momentum.
template <class R, class T, int N>
GRANPINN_HD void subtract_side_walls(const R& u, const R& v, const R& p, const Physics<T>& c,
                                     R (&e)[N]) {
  if (!(c.side_wall > T(0))) return;
  const Sliding<R> way = sliding(u, v, c);
  const R friction = c.side_wall * p;
  e[0] = e[0] + friction * way.along_x;
  e[1] = e[1] + friction * way.along_y;
}

// The adjoint: adds to u_a, v_a and p_a from a_u and a_v, the adjoints of the two residuals.
template <class R, class T>
GRANPINN_HD void add_side_walls_adjoint(const R& u, const R& v, const R& p, const Physics<T>& c,
                                        const R& a_u, const R& a_v, R& u_a, R& v_a, R& p_a) {
  if (!(c.side_wall > T(0))) return;
  const Sliding<R> way = sliding(u, v, c);
  const R along = a_u * way.along_x + a_v * way.along_y;
  const R friction = c.side_wall * p * way.over_speed;
  u_a = u_a + friction * (a_u - along * way.along_x);
  v_a = v_a + friction * (a_v - along * way.along_y);
  p_a = p_a + c.side_wall * along;
}

}  // namespace granpinn
