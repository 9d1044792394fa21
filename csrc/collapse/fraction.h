// Advection of the volume fraction, dc/dt + div(c v) = 0, by one sweep per direction.
//
// Weymouth and Yue, Conservative volume-of-fluid method for free-surface simulations (2010): fluxes
// are exact areas below the reconstructed line, and the dilatation of a sweep is compensated with a
// fraction that is fixed for the whole step. For divergence-free velocities and a CFL number below
// 1/2, c stays within [0, 1] and its sum is conserved.
#pragma once

#include <vector>

#include "field.h"
#include "plic.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

// Fractions within this of 0 or 1 are set to it: the sweeps leave rounding errors behind.
constexpr double kRounding = 1e-12;

// Ghost values continue the grains straight through every side.
inline void fill_fraction_ghosts(Field<double>& c, const Grid& grid) {
  for (int j = 0; j < grid.ny; ++j) {
    double* a = c.row(j);
    for (int g = 1; g <= 2; ++g) {
      a[-g] = grid.periodic() ? a[grid.nx - g] : a[0];
      a[grid.nx - 1 + g] = grid.periodic() ? a[g - 1] : a[grid.nx - 1];
    }
  }
  for (int g = 1; g <= 2; ++g) {
    std::copy_n(c.row(0) - 2, grid.nx + 4, c.row(-g) - 2);
    std::copy_n(c.row(grid.ny - 1) - 2, grid.nx + 4, c.row(grid.ny - 1 + g) - 2);
  }
}

class FractionAdvection {
 public:
  void resize(const Grid& grid) {
    grid_ = grid;
    flux_.resize(grid.nx, grid.ny);
    compensation_.resize(grid.nx, grid.ny);
  }

  // c moves with the face velocities u, v for the time `step`; h is the cell size.
  void advance(Field<double>& c, const Field<double>& u, const Field<double>& v, double step,
               double h, bool vertical_first, Team& team) {
    for (int j = 0; j < grid_.ny; ++j) {
      for (int i = 0; i < grid_.nx; ++i) compensation_(i, j) = c(i, j) > 0.5 ? 1 : 0;
    }
    sweep(c, vertical_first ? v : u, vertical_first, step / h, team);
    sweep(c, vertical_first ? u : v, !vertical_first, step / h, team);
    fill_fraction_ghosts(c, grid_);
  }

 private:
  void sweep(Field<double>& c, const Field<double>& velocity, bool vertical, double scale,
             Team& team) {
    fill_fraction_ghosts(c, grid_);
    const int di = vertical ? 0 : 1, dj = vertical ? 1 : 0;
    team.rows(0, grid_.ny + dj, grid_.nx, [&](int j0, int j1) {
      for (int j = j0; j < j1; ++j) {
        for (int i = 0; i < grid_.nx + di; ++i) {
          flux_(i, j) = flux(c, velocity(i, j) * scale, i, j, di, dj);
        }
      }
    });
    team.rows(0, grid_.ny, grid_.nx, [&](int j0, int j1) {
      for (int j = j0; j < j1; ++j) {
        for (int i = 0; i < grid_.nx; ++i) {
          const double dilatation = (velocity(i + di, j + dj) - velocity(i, j)) * scale;
          const double value =
              c(i, j) + flux_(i, j) - flux_(i + di, j + dj) + compensation_(i, j) * dilatation;
          c(i, j) = value < kRounding ? 0 : value > 1 - kRounding ? 1 : value;
        }
      }
    });
  }

  // Grains that pass the lower or left face of (i, j), as a share of a cell; `shift` = velocity
  // x time / cell size.
  static double flux(const Field<double>& c, double shift, int i, int j, int di, int dj) {
    if (shift == 0) return 0;
    const int from_i = shift > 0 ? i - di : i, from_j = shift > 0 ? j - dj : j;
    const double fraction = c(from_i, from_j);
    if (fraction <= 0) return 0;
    if (fraction >= 1) return shift;
    double around[3][3];
    for (int n = -1; n <= 1; ++n) {
      for (int m = -1; m <= 1; ++m) around[n + 1][m + 1] = c(from_i + m, from_j + n);
    }
    const Normal normal = interface_normal(around);
    const bool across = dj == 1;
    return shift > 0 ? area_in_slab(normal, fraction, 1 - shift, 1, across)
                     : -area_in_slab(normal, fraction, 0, -shift, across);
  }

  Grid grid_;
  Field<double> flux_, compensation_;
};

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
