// Transfer of velocities between two multigrid levels, and means of coefficients.
//
// A coarse face coincides with a pair of fine faces: velocities are interpolated linearly along
// their own direction and bilinearly (3/4, 1/4) across it, which carries rigid motion over exactly.
// Across a side, the ghost value is minus the velocity on a no-slip wall and equal to it elsewhere.
// Restriction is the transpose of interpolation.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "field.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

// Weight of the own coarse row in a fine row next to a side.
template <class S>
S side_weight(Side side) {
  return side == Side::no_slip ? S(0.5) : side == Side::periodic ? S(0.75) : S(1);
}

template <class S>
void prolong_u(const Field<S>& coarse, Field<S>& fine, const Grid& grid, Team& team) {
  const int half_x = grid.nx / 2, half_y = grid.ny / 2;
  team.rows(0, grid.ny, grid.nx, [&](int j0, int j1) {
    std::vector<S> mean(static_cast<std::size_t>(half_x) + 2);
    for (int j = j0; j < j1; ++j) {
      const int J = j / 2, next = J + (j % 2 ? 1 : -1);
      const bool at_side = next < 0 || next == half_y;
      const S own = !at_side ? S(0.75) : side_weight<S>(next < 0 ? grid.bottom : grid.top);
      const S other = at_side ? S(0) : S(0.25);
      const S* a = coarse.row(J);
      const S* b = coarse.row(next);
      for (int I = 0; I <= half_x; ++I) mean[I] = own * a[I] + other * b[I];
      if (grid.periodic()) mean[half_x] = mean[0];
      S* out = fine.row(j);
      for (int I = 0; I < half_x; ++I) {
        out[2 * I] = mean[I];
        out[2 * I + 1] = S(0.5) * (mean[I] + mean[I + 1]);
      }
      out[grid.nx] = mean[half_x];
    }
  });
}

template <class S>
void restrict_u(const Field<S>& fine, Field<S>& coarse, const Grid& grid, Team& team) {
  const int half_y = grid.ny / 2;
  const Range range = grid.coarser().u_faces();
  team.rows(0, half_y, grid.nx * 2, [&](int j0, int j1) {
    std::vector<S> sums(static_cast<std::size_t>(grid.nx) + 4);
    S* sum = sums.data() + 1;  // index -1 .. nx + 1
    for (int J = j0; J < j1; ++J) {
      const bool first = J == 0, last = J == half_y - 1;
      const S w0 = first ? side_weight<S>(grid.bottom) : S(0.75);
      const S w1 = last ? side_weight<S>(grid.top) : S(0.75);
      const S w_below = first ? S(0) : S(0.25), w_above = last ? S(0) : S(0.25);
      const S* a = fine.row(2 * J);
      const S* b = fine.row(2 * J + 1);
      const S* below = fine.row(2 * J - 1);
      const S* above = fine.row(2 * J + 2);
      for (int i = 0; i <= grid.nx; ++i) {
        sum[i] = w0 * a[i] + w1 * b[i] + w_below * below[i] + w_above * above[i];
      }
      sum[-1] = grid.periodic() ? sum[grid.nx - 1] : S(0);
      sum[grid.nx + 1] = S(0);
      S* out = coarse.row(J);
      for (int I = range.i0; I < range.i1; ++I) {
        out[I] = sum[2 * I] + S(0.5) * (sum[2 * I - 1] + sum[2 * I + 1]);
      }
    }
  });
}

template <class S>
void prolong_v(const Field<S>& coarse, Field<S>& fine, const Grid& grid, Team& team) {
  const int half_x = grid.nx / 2;
  const S w_left = side_weight<S>(grid.left), w_right = side_weight<S>(grid.right);
  const S other = grid.periodic() ? S(0.25) : S(0);
  team.rows(0, grid.ny + 1, grid.nx, [&](int j0, int j1) {
    std::vector<S> mean(static_cast<std::size_t>(half_x) + 2);
    for (int j = j0; j < j1; ++j) {
      const S* a = coarse.row(j / 2);
      const S* b = coarse.row(j / 2 + j % 2);
      for (int I = 0; I < half_x; ++I) mean[I] = S(0.5) * (a[I] + b[I]);
      S* out = fine.row(j);
      const int last = half_x - 1;
      out[0] = w_left * mean[0] + other * mean[last];
      for (int I = 0; I < last; ++I) {
        out[2 * I + 1] = S(0.75) * mean[I] + S(0.25) * mean[I + 1];
        out[2 * I + 2] = S(0.75) * mean[I + 1] + S(0.25) * mean[I];
      }
      out[grid.nx - 1] = w_right * mean[last] + other * mean[0];
      if (j == 0) std::fill_n(out, grid.nx, S(0));  // the floor
    }
  });
}

template <class S>
void restrict_v(const Field<S>& fine, Field<S>& coarse, const Grid& grid, Team& team) {
  const int half_x = grid.nx / 2;
  const S w_left = side_weight<S>(grid.left), w_right = side_weight<S>(grid.right);
  const Range range = grid.coarser().v_faces();
  team.rows(range.j0, range.j1, grid.nx * 2, [&](int j0, int j1) {
    std::vector<S> sums(static_cast<std::size_t>(grid.nx) + 2);
    S* sum = sums.data() + 1;  // index -1 .. nx
    for (int J = j0; J < j1; ++J) {
      const S* a = fine.row(2 * J);
      const S* below = fine.row(2 * J - 1);
      const S* above = fine.row(2 * J + 1);
      for (int i = 0; i < grid.nx; ++i) sum[i] = a[i] + S(0.5) * (below[i] + above[i]);
      sum[-1] = grid.periodic() ? sum[grid.nx - 1] : S(0);
      sum[grid.nx] = grid.periodic() ? sum[0] : S(0);
      S* out = coarse.row(J);
      for (int I = range.i0; I < range.i1; ++I) {
        const S w0 = I == 0 ? w_left : S(0.75), w1 = I == half_x - 1 ? w_right : S(0.75);
        out[I] =
            w0 * sum[2 * I] + w1 * sum[2 * I + 1] + S(0.25) * (sum[2 * I - 1] + sum[2 * I + 2]);
      }
    }
  });
}

template <class S>
void average_cells(const Field<S>& fine, Field<S>& coarse, const Grid& grid, Team& team) {
  team.rows(0, grid.ny, grid.nx * 4, [&](int j0, int j1) {
    for (int J = j0; J < j1; ++J) {
      const S* a = fine.row(2 * J);
      const S* b = fine.row(2 * J + 1);
      S* out = coarse.row(J);
      for (int I = 0; I < grid.nx; ++I) {
        out[I] = S(0.25) * (a[2 * I] + a[2 * I + 1] + b[2 * I] + b[2 * I + 1]);
      }
    }
  });
}

// Weights 1/4, 1/2, 1/4 in both directions, reflected at the sides.
template <class S>
void average_corners(const Field<S>& fine, Field<S>& coarse, const Grid& grid,
                     const Grid& coarse_grid, Team& team) {
  team.rows(0, coarse_grid.ny + 1, grid.nx * 2, [&](int j0, int j1) {
    std::vector<S> sums(static_cast<std::size_t>(grid.nx) + 4);
    S* sum = sums.data() + 1;
    for (int J = j0; J < j1; ++J) {
      const S* a = fine.row(2 * J);
      const S* below = fine.row(J == 0 ? 1 : 2 * J - 1);
      const S* above = fine.row(J == coarse_grid.ny ? grid.ny - 1 : 2 * J + 1);
      for (int i = 0; i <= grid.nx; ++i) {
        sum[i] = S(0.5) * a[i] + S(0.25) * (below[i] + above[i]);
      }
      sum[-1] = grid.periodic() ? sum[grid.nx - 1] : sum[1];
      sum[grid.nx + 1] = grid.periodic() ? sum[1] : sum[grid.nx - 1];
      S* out = coarse.row(J);
      for (int I = 0; I <= coarse_grid.nx; ++I) {
        out[I] = S(0.5) * sum[2 * I] + S(0.25) * (sum[2 * I - 1] + sum[2 * I + 1]);
      }
    }
  });
}

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
