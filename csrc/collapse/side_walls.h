// Friction of the side walls of a narrow channel, the force -k p v / |v| on the grains, with
// k = 2 mu_w / W (Jop, Forterre & Pouliquen 2005, J. Fluid Mech. 541).
//
// It is implicit: a drag k p / |v| on the velocity at the end of the step, with p and |v| of its
// start. So it stops grains without turning them around, and holds them if less than k p pushes.
// |v| is at least a small speed: below it, grains creep instead of resting.
#pragma once

#include <cmath>

#include "field.h"

// The hypot of glibc 2.35 differs from its predecessor in errno alone, which nobody reads here. The
// older name lets wheels run with glibc 2.34 too.
#if defined(__GLIBC__) && defined(__x86_64__)
__asm__(".symver hypot, hypot@GLIBC_2.2.5");
#endif

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

// The drag per volume on u (k = 0) or v (k = 1) at a face, from the fraction c, the pressure p and
// the velocity around it. All have ghost values.
inline double side_wall_drag(int k, int i, int j, const Field<double>& c, const Field<double>& p,
                             const Field<double>& u, const Field<double>& v, const Parameters& s) {
  const int di = k == 0 ? 1 : 0, dj = 1 - di;  // to the cell before the face
  const double grains = 0.5 * (c(i, j) + c(i - di, j - dj));
  const double pressure = std::max(0.5 * (p(i, j) + p(i - di, j - dj)), 0.0);
  const Field<double>&along = k == 0 ? u : v, &across = k == 0 ? v : u;
  const double a = along(i, j);
  const double b = 0.25 * (across(i, j) + across(i - di, j - dj) + across(i + dj, j + di) +
                           across(i + dj - di, j + di - dj));
  return s.side_wall * grains * pressure / std::max(std::hypot(a, b), s.side_wall_speed);
}

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
