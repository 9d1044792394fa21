// Piecewise linear interface in a unit cell: the grains fill  m_x x + m_y y < alpha.
//
// The normal (m_x, m_y) points out of the grains, |m_x| + |m_y| = 1.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "isa.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

struct Normal {
  double x = 0, y = 0;
};

// Area of the unit square below the line a x + b y = alpha, a, b >= 0.
inline double area_below(double a, double b, double alpha) {
  if (alpha <= 0) return 0;
  if (alpha >= a + b) return 1;
  if (a > b) std::swap(a, b);
  if (a < 1e-12 * b) return alpha / b;
  double twice = alpha * alpha;
  if (alpha > a) twice -= (alpha - a) * (alpha - a);
  if (alpha > b) twice -= (alpha - b) * (alpha - b);
  return twice / (2 * a * b);
}

// The alpha for which area_below(a, b, alpha) = c; a + b = 1.
inline double line_constant(double a, double b, double c) {
  if (a > b) std::swap(a, b);
  const bool upper = c > 0.5;  // the figure is symmetric about half filling
  const double low = upper ? 1 - c : c;
  const double triangle = a / (2 * b);  // area when the line reaches the first corner
  const double alpha = low <= triangle ? std::sqrt(2 * a * b * low) : b * low + 0.5 * a;
  return upper ? 1 - alpha : alpha;
}

// Grains in the part x0 <= x <= x1 of a cell with this normal and fraction c, as an area; with
// `across` the part is y0 <= y <= y1.
inline double area_in_slab(Normal m, double c, double from, double to, bool across) {
  const double a = std::abs(m.x), b = std::abs(m.y);
  const double alpha = line_constant(a, b, c);
  const double along = across ? m.y : m.x;
  if (along < 0) {  // mirror the cell so that the grains lie at small coordinates
    const double mirrored = 1 - to;
    to = 1 - from;
    from = mirrored;
  }
  const double slope = across ? b : a, other = across ? a : b;
  return (to - from) * area_below(slope * (to - from), other, alpha - slope * from);
}

// Mixed Youngs and centered columns (Aulisa, Manservisi, Scardovelli, Zaleski 2007) from the 3 x 3
// fractions around a cell, c[row][column], row 0 lowest.
inline Normal interface_normal(const double c[3][3]) {
  const double column[3] = {c[0][0] + c[1][0] + c[2][0], c[0][1] + c[1][1] + c[2][1],
                            c[0][2] + c[1][2] + c[2][2]};
  const double row[3] = {c[0][0] + c[0][1] + c[0][2], c[1][0] + c[1][1] + c[1][2],
                         c[2][0] + c[2][1] + c[2][2]};
  const double left_right = column[0] - column[2], below_above = row[0] - row[2];
  const double youngs_x = left_right + c[1][0] - c[1][2],
               youngs_y = below_above + c[0][1] - c[2][1];
  Normal m;
  if (std::abs(left_right) <= std::abs(below_above)) {  // the line is a function y(x)
    m = {0.5 * left_right, below_above > 0 ? 1.0 : -1.0};
    if (std::abs(youngs_x) > std::abs(m.x * youngs_y)) m = {youngs_x, youngs_y};
  } else {
    m = {left_right > 0 ? 1.0 : -1.0, 0.5 * below_above};
    if (std::abs(youngs_y) > std::abs(m.y * youngs_x)) m = {youngs_x, youngs_y};
  }
  const double size = std::abs(m.x) + std::abs(m.y);
  return size > 0 ? Normal{m.x / size, m.y / size} : Normal{0, 1};
}

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
