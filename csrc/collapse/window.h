// The part of the box in which the equations are solved: it starts at the lower left corner and
// ends a little beyond the grains, where the air is open to the outside (p = 0, no traction).
#pragma once

#include "field.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

// Number of cells in one direction: room for `occupied` cells of grains and the margin, in whole
// chunks, at most the box. A window that is slightly too large is kept.
inline int window_size(int occupied, int present, int box, const Parameters& s) {
  if (s.margin < 0) return box;
  const int needed = occupied + s.margin;
  const int rounded = std::min((needed + s.chunk - 1) / s.chunk * s.chunk, box);
  const bool keep = rounded == present - s.chunk && needed + s.chunk / 2 > rounded;
  return keep ? present : rounded;
}

inline Grid window_grid(int nx, int ny, const Parameters& s) {
  return {nx,       ny,
          s.left,   nx == s.cells_x ? s.right : Side::open,
          s.bottom, ny == s.cells_y ? s.top : Side::open};
}

// Columns and rows of a box or window of nx x ny cells that hold grains, c(i, j) of a cell.
template <class F>
void occupied_cells(const F& c, int nx, int ny, int& columns, int& rows) {
  columns = rows = 0;
  for (int j = 0; j < ny; ++j) {
    int i = nx;
    while (i > 0 && c(i - 1, j) <= 0) --i;
    if (i > 0) rows = j + 1;
    columns = std::max(columns, i);
  }
}

// The field on a window of another size; beyond the old one it is continued by the nearest value,
// or by 0.
inline Field<double> moved_to(const Field<double>& field, int old_nx, int old_ny, int nx, int ny,
                              bool continued) {
  Field<double> moved(nx, ny);
  for (int j = 0; j <= ny; ++j) {
    for (int i = 0; i <= nx; ++i) {
      const bool inside = i < old_nx && j < old_ny;
      if (!inside && !continued) continue;
      moved(i, j) = field(std::min(i, old_nx - 1), std::min(j, old_ny - 1));
    }
  }
  return moved;
}

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
