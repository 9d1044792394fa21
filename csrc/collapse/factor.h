// A factor on the friction, from place to place: 1 for one material, the same at all times.
#pragma once

#include <algorithm>
#include <vector>

#include "isa.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

class Factor {
 public:
  // At cell centers of the box, ny rows of nx.
  void set(const double* values, int nx, int ny) {
    values_.assign(values, values + static_cast<std::size_t>(nx) * ny);
    nx_ = nx;
    ny_ = ny;
  }
  double at_center(int i, int j) const {
    if (values_.empty()) return 1;
    const int column = std::clamp(i, 0, nx_ - 1), row = std::clamp(j, 0, ny_ - 1);
    return values_[static_cast<std::size_t>(row) * nx_ + column];
  }
  // The mean of the four cells around the lower left corner of cell (i, j).
  double at_corner(int i, int j) const {
    if (values_.empty()) return 1;
    return 0.25 *
           (at_center(i, j) + at_center(i - 1, j) + at_center(i, j - 1) + at_center(i - 1, j - 1));
  }

 private:
  std::vector<double> values_;
  int nx_ = 0, ny_ = 0;
};

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
