// The pressure equation  - div(1/rho grad p) = b, integrated over cells, on one multigrid level.
//
// by_x(i, j) and by_y(i, j) are 1/rho on the left and the lower face of cell (i, j), 0 on walls and
// twice 1/rho on open sides, where p = 0 on the face itself, half a cell away; ghost values are 0.
#pragma once

#include <vector>

#include "band_matrix.h"
#include "field.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

template <class S>
struct PoissonLevel {
  using Scalar = S;
  static constexpr int kCount = 1;
  static constexpr double kLargestEigenvalue = 2;  // Gershgorin: row sums of |A| are <= 2 diagonal

  Grid grid;
  Field<S> by_x, by_y;
  Vector<S, 1> inverse;

  Range range(int) const { return grid.cells(); }

  void resize(const Grid& new_grid) {
    grid = new_grid;
    by_x.resize(grid.nx, grid.ny);
    by_y.resize(grid.nx, grid.ny);
    inverse.resize(grid.nx, grid.ny);
  }

  template <class Emit>
  void apply_rows(const Vector<S, 1>& x, int j0, int j1, Emit emit) const {
    thread_local std::vector<S> buffer;
    buffer.resize(static_cast<std::size_t>(grid.nx) + 1);
    S* ax = buffer.data();
    for (int j = j0; j < std::min(j1, grid.ny); ++j) {
      const S* p = x[0].row(j);
      const S* below = x[0].row(j - 1);
      const S* above = x[0].row(j + 1);
      const S* bx = by_x.row(j);
      const S* by = by_y.row(j);
      const S* by_above = by_y.row(j + 1);
      GRANPINN_INDEPENDENT
      for (int i = 0; i < grid.nx; ++i) {
        ax[i] = bx[i] * (p[i] - p[i - 1]) - bx[i + 1] * (p[i + 1] - p[i]) +
                by[i] * (p[i] - below[i]) - by_above[i] * (above[i] - p[i]);
      }
      emit(0, j, 0, grid.nx, ax);
    }
  }

  // 1 / diagonal, from the coefficients.
  void finish(Team& team) {
    if (grid.periodic()) by_x.wrap();
    team.rows(0, grid.ny, grid.nx, [&](int j0, int j1) {
      for (int j = j0; j < j1; ++j) {
        for (int i = 0; i < grid.nx; ++i) {
          inverse[0](i, j) = S(1) / (by_x(i, j) + by_x(i + 1, j) + by_y(i, j) + by_y(i, j + 1));
        }
      }
    });
  }

  // A coarse face joins two fine ones over twice the distance: the mean of their coefficients.
  void coarsen(PoissonLevel& coarse, Team& team) const {
    team.rows(0, coarse.grid.ny + 1, coarse.grid.nx, [&](int j0, int j1) {
      for (int J = j0; J < j1; ++J) {
        for (int I = 0; I <= coarse.grid.nx; ++I) {
          const int i = 2 * I, j = 2 * J;
          if (J < coarse.grid.ny) coarse.by_x(I, J) = S(0.5) * (by_x(i, j) + by_x(i, j + 1));
          if (I < coarse.grid.nx) coarse.by_y(I, J) = S(0.5) * (by_y(i, j) + by_y(i + 1, j));
        }
      }
    });
    coarse.finish(team);
  }

  // Piecewise constant transfer: interpolation across the free surface would tie the pressure of
  // the grains to that of the air, whose coefficient is 1e4 times larger.
  void restrict_to(const Vector<S, 1>& r, Vector<S, 1>& coarse, Team& team) const {
    team.rows(0, grid.ny / 2, grid.nx / 2, [&](int j0, int j1) {
      for (int J = j0; J < j1; ++J) {
        const S* a = r[0].row(2 * J);
        const S* b = r[0].row(2 * J + 1);
        S* out = coarse[0].row(J);
        for (int I = 0; I < grid.nx / 2; ++I) {
          out[I] = a[2 * I] + a[2 * I + 1] + b[2 * I] + b[2 * I + 1];
        }
      }
    });
  }
  void prolong_from(const Vector<S, 1>& coarse, Vector<S, 1>& x, Team& team) const {
    team.rows(0, grid.ny, grid.nx, [&](int j0, int j1) {
      for (int j = j0; j < j1; ++j) {
        const S* from = coarse[0].row(j / 2);
        S* out = x[0].row(j);
        for (int I = 0; I < grid.nx / 2; ++I) out[2 * I] = out[2 * I + 1] = from[I];
      }
    });
  }

  void factorise(BandMatrix& matrix) const {
    const int nx = grid.nx;
    matrix.reset(nx * grid.ny, nx);
    const auto link = [&](int i, int j, bool has_left, int left, double b) {
      const int here = j * nx + i;
      const bool inside = i < nx && j < grid.ny;
      if (inside) matrix.add(here, here, b);
      if (has_left) matrix.add(left, left, b);
      if (inside && has_left) matrix.add(here, left, -b);
    };
    for (int j = 0; j <= grid.ny; ++j) {
      for (int i = 0; i <= nx; ++i) {
        if (j < grid.ny && grid.periodic()) {
          if (i < nx) link(i, j, true, j * nx + (i + nx - 1) % nx, by_x(i, j));
        } else if (j < grid.ny) {
          link(i, j, i > 0, j * nx + i - 1, by_x(i, j));
        }
        if (i < nx) link(i, j, j > 0, (j - 1) * nx + i, by_y(i, j));
      }
    }
    matrix.factorise();
  }
  void solve(const BandMatrix& matrix, const Vector<S, 1>& b, Vector<S, 1>& x) const {
    std::vector<double> values(static_cast<std::size_t>(matrix.size()));
    std::size_t n = 0;
    for (int j = 0; j < grid.ny; ++j) {
      for (int i = 0; i < grid.nx; ++i) values[n++] = static_cast<double>(b[0](i, j));
    }
    matrix.solve(values);
    n = 0;
    for (int j = 0; j < grid.ny; ++j) {
      for (int i = 0; i < grid.nx; ++i) x[0](i, j) = static_cast<S>(values[n++]);
    }
  }
};

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
