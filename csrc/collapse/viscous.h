// The viscous step  rho u / dt - div(2 eta D(u)) = b, integrated over the volume of every face, on
// one multigrid level. In two dimensions its viscous part does not depend on the cell size.
//
//   cell(i, j)      2 eta at the center: the normal stresses 2 eta u_x, 2 eta v_y
//   corner(i, j)    eta at the lower left corner: the shear stress eta (u_y + v_x);
//                   0 on free-slip and open sides, and doubled on no-slip walls, where the
//                   velocity vanishes half a cell away (ghost values are 0)
//   mass[0], [1]    rho h^2 / dt at u and v faces, half of it on open sides, and the drag of side
//                   walls (side_walls.h)
#pragma once

#include <utility>
#include <vector>

#include "band_matrix.h"
#include "field.h"
#include "transfer.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

template <class S>
struct ViscousLevel {
  using Scalar = S;
  static constexpr int kCount = 2;
  // The energy is a sum over corners of rank-one terms in four velocities and over cells of terms
  // in two: diag(A)^-1 A <= 4 whatever the viscosity.
  static constexpr double kLargestEigenvalue = 4;

  Grid grid;
  Field<S> cell, corner, corner_eta;  // corner_eta: corner before the factors of the sides
  Vector<S, 2> mass, inverse;

  Range range(int k) const { return k == 0 ? grid.u_faces() : grid.v_faces(); }

  void resize(const Grid& new_grid) {
    grid = new_grid;
    for (Field<S>* field : {&cell, &corner, &corner_eta}) field->resize(grid.nx, grid.ny);
    mass.resize(grid.nx, grid.ny);
    inverse.resize(grid.nx, grid.ny);
  }

  template <class Emit>
  void apply_rows(const Vector<S, 2>& x, int j0, int j1, Emit emit) const {
    const std::size_t width = static_cast<std::size_t>(grid.nx) + 4;
    thread_local std::vector<S> buffer;
    buffer.resize(7 * width);
    S* normal_x = buffer.data() + 1;  // index -1 .. nx
    S* normal_y = normal_x + width;
    S* normal_y_below = normal_y + width;
    S* shear = normal_y_below + width;
    S* shear_above = shear + width;
    S* au = shear_above + width;
    S* av = au + width;
    const Range ur = range(0), vr = range(1);
    normal_y_row(x, j0 - 1, normal_y_below);
    shear_row(x, j0, shear);
    for (int j = j0; j < j1; ++j) {
      normal_x_row(x, j, normal_x);
      normal_y_row(x, j, normal_y);
      shear_row(x, j + 1, shear_above);
      if (j < ur.j1) {
        const S* u = x[0].row(j);
        const S* m = mass[0].row(j);
        GRANPINN_INDEPENDENT
        for (int i = ur.i0; i < ur.i1; ++i) {
          au[i] = m[i] * u[i] - (normal_x[i] - normal_x[i - 1] + shear_above[i] - shear[i]);
        }
        emit(0, j, ur.i0, ur.i1, au);
      }
      if (j >= vr.j0 && j < vr.j1) {
        const S* v = x[1].row(j);
        const S* m = mass[1].row(j);
        GRANPINN_INDEPENDENT
        for (int i = vr.i0; i < vr.i1; ++i) {
          av[i] = m[i] * v[i] - (normal_y[i] - normal_y_below[i] + shear[i + 1] - shear[i]);
        }
        emit(1, j, vr.i0, vr.i1, av);
      }
      std::swap(normal_y, normal_y_below);
      std::swap(shear, shear_above);
    }
  }

  // Computes the coefficients of `apply` from cell, corner_eta and mass.
  void finish(Team& team) {
    if (grid.periodic()) {
      cell.wrap();
      corner_eta.wrap();
    }
    const auto factor = [](Side side) { return side == Side::no_slip ? S(2) : S(0); };
    team.rows(0, grid.ny + 1, grid.nx, [&](int j0, int j1) {
      for (int j = j0; j < j1; ++j) {
        const S row_factor = j == 0 ? factor(grid.bottom) : j == grid.ny ? factor(grid.top) : S(1);
        const S* eta = corner_eta.row(j);
        S* out = corner.row(j);
        for (int i = 0; i <= grid.nx; ++i) out[i] = row_factor * eta[i];
        if (!grid.periodic()) {
          out[0] *= factor(grid.left);
          out[grid.nx] *= factor(grid.right);
        }
      }
    });
    team.rows(0, grid.ny + 1, grid.nx, [&](int j0, int j1) {
      for (int j = j0; j < j1; ++j) {
        const Range ur = range(0), vr = range(1);
        for (int i = ur.i0; i < ur.i1 && j < ur.j1; ++i) {
          inverse[0](i, j) = S(1) / (mass[0](i, j) + cell(i, j) + cell(i - 1, j) + corner(i, j) +
                                     corner(i, j + 1));
        }
        for (int i = vr.i0; i < vr.i1 && j >= vr.j0 && j < vr.j1; ++i) {
          inverse[1](i, j) = S(1) / (mass[1](i, j) + cell(i, j) + cell(i, j - 1) + corner(i, j) +
                                     corner(i + 1, j));
        }
      }
    });
  }

  // Arithmetic means of the viscosity: a coarse operator that is too soft would overcorrect.
  void coarsen(ViscousLevel& coarse, Team& team) const {
    average_cells(cell, coarse.cell, coarse.grid, team);
    average_corners(corner_eta, coarse.corner_eta, grid, coarse.grid, team);
    restrict_to(mass, coarse.mass, team);
    if (grid.periodic()) {
      for (auto& field : coarse.mass.part) field.wrap();
    }
    coarse.finish(team);
  }
  void restrict_to(const Vector<S, 2>& r, Vector<S, 2>& coarse, Team& team) const {
    restrict_u(r[0], coarse[0], grid, team);
    restrict_v(r[1], coarse[1], grid, team);
  }
  void prolong_from(const Vector<S, 2>& coarse, Vector<S, 2>& x, Team& team) const {
    prolong_u(coarse[0], x[0], grid, team);
    prolong_v(coarse[1], x[1], grid, team);
  }

  void factorise(BandMatrix& matrix) const {
    const int width = (grid.periodic() ? 4 : 2) * grid.nx + 5;
    matrix.reset(2 * (grid.nx + 1) * (grid.ny + 1), width);
    for (int j = 0; j <= grid.ny; ++j) {
      for (int i = 0; i < grid.nx + (grid.periodic() ? 0 : 1); ++i) {
        add_term(matrix, cell(i, j), {{{0, i + 1, j, 1}, {0, i, j, -1}}});
        add_term(matrix, cell(i, j), {{{1, i, j + 1, 1}, {1, i, j, -1}}});
        add_term(matrix, corner(i, j),
                 {{{0, i, j, 1}, {0, i, j - 1, -1}, {1, i, j, 1}, {1, i - 1, j, -1}}});
      }
    }
    for (int k = 0; k < 2; ++k) {
      for (int j = 0; j <= grid.ny; ++j) {
        for (int i = 0; i <= grid.nx; ++i) {
          const int n = index(k, i, j);
          const bool unknown = is_unknown(k, i, j);
          matrix.add(n, n, unknown ? static_cast<double>(mass[k](i, j)) : 1.0);
        }
      }
    }
    matrix.factorise();
  }
  void solve(const BandMatrix& matrix, const Vector<S, 2>& b, Vector<S, 2>& x) const {
    std::vector<double> values(static_cast<std::size_t>(matrix.size()), 0.0);
    for (int k = 0; k < 2; ++k) {
      const Range r = range(k);
      for (int j = r.j0; j < r.j1; ++j) {
        for (int i = r.i0; i < r.i1; ++i) {
          values[index(k, i, j)] = static_cast<double>(b[k](i, j));
        }
      }
    }
    matrix.solve(values);
    for (int k = 0; k < 2; ++k) {
      const Range r = range(k);
      for (int j = r.j0; j < r.j1; ++j) {
        for (int i = r.i0; i < r.i1; ++i) {
          x[k](i, j) = static_cast<S>(values[index(k, i, j)]);
        }
      }
    }
  }

 private:
  struct Term {
    int k, i, j;
    double sign;
  };

  void normal_x_row(const Vector<S, 2>& x, int j, S* out) const {
    const S* eta = cell.row(j);
    const S* u = x[0].row(j);
    GRANPINN_INDEPENDENT
    for (int i = -1; i <= grid.nx; ++i) out[i] = eta[i] * (u[i + 1] - u[i]);
  }
  void normal_y_row(const Vector<S, 2>& x, int j, S* out) const {
    const S* eta = cell.row(j);
    const S* v = x[1].row(j);
    const S* above = x[1].row(j + 1);
    GRANPINN_INDEPENDENT
    for (int i = 0; i < grid.nx; ++i) out[i] = eta[i] * (above[i] - v[i]);
  }
  void shear_row(const Vector<S, 2>& x, int j, S* out) const {
    const S* eta = corner.row(j);
    const S* u = x[0].row(j);
    const S* below = x[0].row(j - 1);
    const S* v = x[1].row(j);
    GRANPINN_INDEPENDENT
    for (int i = 0; i <= grid.nx; ++i) out[i] = eta[i] * (u[i] - below[i] + v[i] - v[i - 1]);
  }

  int index(int k, int i, int j) const { return 2 * (j * (grid.nx + 1) + i) + k; }
  bool is_unknown(int k, int i, int j) const {
    const Range r = range(k);
    return i >= r.i0 && i < r.i1 && j >= r.j0 && j < r.j1;
  }
  // Adds eta s s^T, s the signs of the velocities in `terms`; unknowns on walls are left out.
  void add_term(BandMatrix& matrix, S eta, std::vector<Term> terms) const {
    if (eta == S(0)) return;
    if (grid.periodic()) {
      for (Term& term : terms) term.i = (term.i + grid.nx) % grid.nx;
    }
    for (std::size_t a = 0; a < terms.size(); ++a) {
      if (!is_unknown(terms[a].k, terms[a].i, terms[a].j)) continue;
      for (std::size_t b = 0; b <= a; ++b) {
        if (!is_unknown(terms[b].k, terms[b].i, terms[b].j)) continue;
        const int m = index(terms[a].k, terms[a].i, terms[a].j);
        const int n = index(terms[b].k, terms[b].i, terms[b].j);
        const double both = m == n && a != b ? 2.0 : 1.0;
        matrix.add(m, n, both * static_cast<double>(eta) * terms[a].sign * terms[b].sign);
      }
    }
  }
};

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
