// The viscosity of the mixture at cell centers and corners: strain rate, pressure and fraction.
//
//   gamma_dot = sqrt(2 D:D),  eta_g = (cohesion + mu(I) p) / gamma_dot within [eta_min, eta_max]
//   1 / eta = c / eta_g + (1 - c) / eta_air                       (paper, equations means and eta)
// The paper prints max(eta_g, eta_max) for the clamp; that is a slip for min.
#pragma once

#include <cmath>

#include "field.h"
#include "fraction.h"
#include "strain.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

template <class Law>
double grain_viscosity(double gamma_dot_squared, double p, const Friction<Law>& friction,
                       const Parameters& s) {
  if (s.newtonian) return s.eta_max;
  const double positive = std::max(p, 0.0);
  const double gamma_dot = std::sqrt(gamma_dot_squared) + 1e-300;
  const double stress =
      friction.cohesion + friction.mu(inertial_number(gamma_dot, positive, s)) * positive;
  return std::min(std::max(stress / gamma_dot, s.eta_min), s.eta_max);
}

inline double mixture_viscosity(double c, double eta_grains, double eta_air) {
  return 1 / (c / eta_grains + (1 - c) / eta_air);
}

// Ghost pressures: linear towards walls, even at a free-slip side, 0 on open sides.
inline void fill_pressure_ghosts(Field<double>& p, const Grid& grid) {
  const auto ghost = [](Side side, double first, double second) {
    return side == Side::open ? -first : side == Side::no_slip ? 2 * first - second : first;
  };
  const int nx = grid.nx, ny = grid.ny;
  for (int j = 0; j < ny; ++j) {
    double* a = p.row(j);
    a[-1] = grid.periodic() ? a[nx - 1] : ghost(grid.left, a[0], a[1]);
    a[nx] = grid.periodic() ? a[0] : ghost(grid.right, a[nx - 1], a[nx - 2]);
  }
  for (int i = -1; i <= nx; ++i) {
    p(i, -1) = ghost(grid.bottom, p(i, 0), p(i, 1));
    p(i, ny) = ghost(grid.top, p(i, ny - 1), p(i, ny - 2));
  }
}

// Volume fractions for the viscosity alone: air in the lowest row below grains counts as grains.
// The toe rolls over pockets of air, which an incompressible gas cannot leave. It would glide on
// them, while between real grains the air drains.
inline void drain_floor(Field<double>& c, const Grid& grid) {
  for (int i = 0; i < grid.nx; ++i) c(i, 0) = std::max(c(i, 0), c(i, 1));
  fill_fraction_ghosts(c, grid);
}

// All fields with their ghost values. cell = eta at centers, corner = eta at corners.
template <class Law>
void mixture_viscosity(const Friction<Law>& friction, const StrainRate& strain,
                       const Field<double>& p, const Field<double>& c, Field<double>& cell,
                       Field<double>& corner, const Grid& grid, const Parameters& s, Team& team) {
  team.rows(0, grid.ny + 1, grid.nx * 4, [&](int j0, int j1) {
    for (int j = j0; j < j1; ++j) {
      for (int i = 0; i < grid.nx && j < grid.ny; ++i) {
        double eta = s.air_viscosity;
        if (c(i, j) > 0) {
          const double squared = strain.squared_at_center(i, j, p(i, j), c, friction, s);
          eta = mixture_viscosity(c(i, j), grain_viscosity(squared, p(i, j), friction, s), eta);
        }
        cell(i, j) = eta;
      }
      for (int i = 0; i <= grid.nx; ++i) {
        const double fraction = 0.25 * (c(i, j) + c(i - 1, j) + c(i, j - 1) + c(i - 1, j - 1));
        double eta = s.air_viscosity;
        if (fraction > 0) {
          const double p_here = 0.25 * (p(i, j) + p(i - 1, j) + p(i, j - 1) + p(i - 1, j - 1));
          const double squared = strain.squared_at_corner(i, j, p_here, c, friction, s);
          eta = mixture_viscosity(fraction, grain_viscosity(squared, p_here, friction, s), eta);
        }
        corner(i, j) = eta;
      }
    }
  });
}

// The lowest viscosity around a center, 0 unless all nine cells hold nothing but grains. Beyond
// periodic sides, c and cell have ghost values.
inline void plug_viscosity(const Field<double>& c, const Field<double>& cell,
                           const Field<double>& corner, Field<double>& plug, const Grid& grid,
                           Team& team) {
  const int first = grid.periodic() ? -1 : 0, last = grid.periodic() ? grid.nx : grid.nx - 1;
  team.rows(0, grid.ny, grid.nx * 4, [&](int j0, int j1) {
    for (int j = j0; j < j1; ++j) {
      for (int i = 0; i < grid.nx; ++i) {
        double least_c = 1;
        double least = std::min(std::min(corner(i, j), corner(i + 1, j)),
                                std::min(corner(i, j + 1), corner(i + 1, j + 1)));
        for (int n = std::max(j - 1, 0); n <= std::min(j + 1, grid.ny - 1); ++n) {
          for (int m = std::max(i - 1, first); m <= std::min(i + 1, last); ++m) {
            least_c = std::min(least_c, c(m, n));
            least = std::min(least, cell(m, n));
          }
        }
        plug(i, j) = least_c < 1 ? 0 : least;
      }
    }
  });
}

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
