// The momentum advection  div(v v)  on the staggered grid, and the ghost values of velocities.
//
// Third-order upwind-biased interpolation (kappa = 1/3). The given velocity is extrapolated to the
// middle of the time step, so the term is of second order in time.
#pragma once

#include <utility>
#include <vector>

#include "field.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

// Two ghost values on every side. Along a wall, the velocity is odd (no slip) or even (free slip);
// through it, odd (free slip) or even (no slip: continuity makes its slope vanish).
inline double along(Side side) { return side == Side::no_slip ? -1.0 : 1.0; }
inline double through(Side side) { return side == Side::free_slip ? -1.0 : 1.0; }

inline void fill_ghosts_beside_row(Field<double>& u, Field<double>& v, int j, const Grid& grid) {
  const int nx = grid.nx;
  double* a = u.row(j);
  double* b = v.row(j);
  for (int g = 1; g <= 2; ++g) {
    const bool left_open = grid.left == Side::open, right_open = grid.right == Side::open;
    a[-g] = left_open ? a[0] : through(grid.left) * a[g];
    a[nx + g] = right_open ? a[nx] : through(grid.right) * a[nx - g];
    b[-g] = along(grid.left) * (left_open ? b[0] : b[g - 1]);
    b[nx - 1 + g] = along(grid.right) * (right_open ? b[nx - 1] : b[nx - g]);
  }
}

inline void fill_velocity_ghosts(Field<double>& u, Field<double>& v, const Grid& grid) {
  const int nx = grid.nx, ny = grid.ny;
  for (int j = 0; j <= ny; ++j) fill_ghosts_beside_row(u, v, j, grid);
  if (grid.periodic()) {
    u.wrap();
    v.wrap();
  }
  const bool top_open = grid.top == Side::open;
  for (int g = 1; g <= 2; ++g) {
    for (int i = -2; i <= nx + 2; ++i) {
      u(i, -g) = along(grid.bottom) * u(i, g - 1);
      u(i, ny - 1 + g) = along(grid.top) * (top_open ? u(i, ny - 1) : u(i, ny - g));
      v(i, -g) = through(grid.bottom) * v(i, g);
      v(i, ny + g) = top_open ? v(i, ny) : through(grid.top) * v(i, ny - g);
    }
  }
}

// Value between a and b, interpolated with the upstream neighbour.
inline double upwind(double velocity, double before, double a, double b, double after) {
  const double from_a = (2 * b + 5 * a - before) / 6, from_b = (2 * a + 5 * b - after) / 6;
  return velocity > 0 ? from_a : from_b;
}

// au, av = div(v v) on the faces whose velocity is unknown. u, v have ghost values.
inline void advect_momentum(const Field<double>& u, const Field<double>& v, Field<double>& au,
                            Field<double>& av, const Grid& grid, double h, Team& team) {
  const Range ur = grid.u_faces(), vr = grid.v_faces();
  team.rows(0, grid.ny + 1, grid.nx, [&](int j0, int j1) {
    const std::size_t width = static_cast<std::size_t>(grid.nx) + 4;
    std::vector<double> buffer(6 * width);
    // Fluxes of u through centers (index i + 1 for cell i) and corners, of v through the same.
    double* u_center = buffer.data() + 1;
    double* u_low = u_center + width;
    double* u_high = u_low + width;
    double* v_corner = u_high + width;
    double* v_low = v_corner + width;
    double* v_high = v_low + width;
    const auto u_corner_row = [&](int j, double* out) {
      const double *a = u.row(j - 2), *b = u.row(j - 1), *c = u.row(j), *d = u.row(j + 1);
      const double* w = v.row(j);
      for (int i = 0; i <= grid.nx; ++i) {
        const double velocity = 0.5 * (w[i - 1] + w[i]);
        out[i] = velocity * upwind(velocity, a[i], b[i], c[i], d[i]);
      }
    };
    const auto v_center_row = [&](int j, double* out) {
      const double *a = v.row(j - 1), *b = v.row(j), *c = v.row(j + 1), *d = v.row(j + 2);
      for (int i = 0; i < grid.nx; ++i) {
        const double velocity = 0.5 * (b[i] + c[i]);
        out[i] = velocity * upwind(velocity, a[i], b[i], c[i], d[i]);
      }
    };
    u_corner_row(j0, u_low);
    v_center_row(j0 - 1, v_low);
    for (int j = j0; j < j1; ++j) {
      const double* a = u.row(j);
      const double* below = u.row(j - 1);
      const double* b = v.row(j);
      if (j < ur.j1) {
        u_corner_row(j + 1, u_high);
        for (int i = -1; i <= grid.nx; ++i) {
          const double velocity = 0.5 * (a[i] + a[i + 1]);
          u_center[i] = velocity * upwind(velocity, a[i - 1], a[i], a[i + 1], a[i + 2]);
        }
        double* out = au.row(j);
        for (int i = ur.i0; i < ur.i1; ++i) {
          out[i] = (u_center[i] - u_center[i - 1] + u_high[i] - u_low[i]) / h;
        }
      }
      if (j < grid.ny || grid.top == Side::open) {
        v_center_row(std::min(j, grid.ny - 1), v_high);
        for (int i = 0; i <= grid.nx; ++i) {
          const double velocity = 0.5 * (below[i] + a[i]);
          v_corner[i] = velocity * upwind(velocity, b[i - 2], b[i - 1], b[i], b[i + 1]);
        }
      }
      if (j >= vr.j0 && j < vr.j1) {
        double* out = av.row(j);
        for (int i = vr.i0; i < vr.i1; ++i) {
          out[i] = (v_high[i] - v_low[i] + v_corner[i + 1] - v_corner[i]) / h;
        }
      }
      std::swap(u_low, u_high);
      std::swap(v_low, v_high);
    }
  });
}

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
