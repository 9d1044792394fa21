// The constants of a problem, all dimensionless (granpinn/physics/constants.py has the same fields
// in the same order).
#pragma once

#include "scalar.h"

namespace granpinn {

template <class T>
struct Physics {
  T grain_diameter;
  T g_x, g_y;
  T eta_min, eta_max;
  T velocity_scale, pressure_scale;  // of the network's raw outputs
  T pressure_floor;                  // under the root of I
  T law_rate;                        // shear rate that limits the residual of the law (mixed form)
  T side_wall, side_wall_speed;      // k and s of side_walls.h
  T v_factor;                        // 0 where v = 0 everywhere, else 1

  // The scale of u (field 0) or v (field 1).
  GRANPINN_HD T scale_of(int field) const {
    return field == 0 ? velocity_scale : velocity_scale * v_factor;
  }
};

constexpr const char* kPhysicsFields[] = {"grain_diameter",
                                          "g_x",
                                          "g_y",
                                          "eta_min",
                                          "eta_max",
                                          "velocity_scale",
                                          "pressure_scale",
                                          "pressure_floor",
                                          "law_rate",
                                          "side_wall",
                                          "side_wall_speed",
                                          "v_factor"};
constexpr int kPhysics = sizeof(kPhysicsFields) / sizeof(kPhysicsFields[0]);
static_assert(sizeof(Physics<double>) == kPhysics * sizeof(double), "every field has its name");

template <class T, class From>
GRANPINN_HD Physics<T> physics_from(const From* a) {
  return {T(a[0]), T(a[1]), T(a[2]), T(a[3]), T(a[4]),  T(a[5]),
          T(a[6]), T(a[7]), T(a[8]), T(a[9]), T(a[10]), T(a[11])};
}

//   I = d gamma_dot / sqrt(|p|)                          (paper, eq. I)
template <class R, class T>
GRANPINN_HD R inertial_number(const R& gamma_dot, const R& p, const Physics<T>& c) {
  const R floored = maximum(absolute(p), R(c.pressure_floor));
  return c.grain_diameter * gamma_dot / square_root(floored);
}

}  // namespace granpinn
