// The batches of E members, drawn from their data: a pure function of (seed, step).
#pragma once

#include <limits>

#include "checked.h"
#include "math/philox.h"
#include "step.h"

namespace granpinn {

// Streams of the generator, as in granpinn/training/objective.py.
constexpr std::uint32_t kInteriorStream = 0, kSurfaceStream = 1;

template <class T>
struct BatchArguments {
  Control control;
  std::int64_t N, M;               // points and surface points of the data
  std::int64_t interior, surface;  // points of a member
  const std::int64_t* seeds;       // [E]
  const std::int64_t* places;      // [E, 4]: first point, points; first surface point, their number
  const T* points;                 // [N, 3]
  const T* velocity;               // [N, 2]
  const T* point_weights;          // [N, 2]
  const T* surface_points;         // [M, 3]
  const T* surface_pressure;       // [M]
  const T* term_weights;           // [E, kTerms]
  const T* source;                 // [N, 2], or null
  T* to_points;                    // [E, interior, 3]
  T* to_velocity;
  T* to_point_weights;
  T* to_surface_points;  // [E, surface, 3]
  T* to_surface_pressure;
  T* to_term_weights;  // [E, kTerms]
  T* to_source;        // [E, interior, 2], or null
};

// Row i of a table: all rows are read before one is stored, so that the loads overlap. NaN for the
// row kNowhere.
constexpr std::int64_t kNowhere = -1;

template <int K, class T>
struct Row {
  T values[K];

  GRANPINN_HD Row(const T* from, std::int64_t i) {
    const std::int64_t there = i == kNowhere ? 0 : i;
    for (int k = 0; k < K; ++k) values[k] = from[K * there + k];
    for (int k = 0; k < K; ++k)
      values[k] = i == kNowhere ? std::numeric_limits<T>::quiet_NaN() : values[k];
  }
  GRANPINN_HD void put(T* to, std::int64_t j) const {
    for (int k = 0; k < K; ++k) to[K * j + k] = values[k];
  }
};

// Whether the place (first row, rows) of a member lies within the rows of a table. A generator of
// 32 bits draws from it.
GRANPINN_HD bool is_place(const std::int64_t* place, std::int64_t rows) {
  return place[1] >= 1 && place[1] <= INT64_C(0xFFFFFFFF) && within(place[0], place[1], rows);
}

// The row that element i of a batch of `count` takes from `place`; kNowhere if there is no such
// place. The operator refuses such places on a CPU. A GPU does not stop: the loss is NaN, a fault.
template <class T>
GRANPINN_HD std::int64_t drawn_row(const BatchArguments<T>& a, const std::int64_t* place,
                                   std::int64_t rows, std::int64_t e, std::uint32_t stream,
                                   std::int64_t i, std::int64_t step) {
  const std::int64_t drawn =
      sample_index(static_cast<std::uint64_t>(a.seeds[e]), static_cast<std::uint64_t>(step), stream,
                   static_cast<std::uint32_t>(i), static_cast<std::uint64_t>(place[1]));
  return is_place(place, rows) ? place[0] + drawn : kNowhere;
}

// Point i of member e.
template <class T>
GRANPINN_HD void draw_point(const BatchArguments<T>& a, std::int64_t e, std::int64_t i,
                            std::int64_t step) {
  const std::int64_t from = drawn_row(a, a.places + 4 * e, a.N, e, kInteriorStream, i, step);
  const std::int64_t to = e * a.interior + i;
  const Row<3, T> point(a.points, from);
  const Row<2, T> velocity(a.velocity, from), weights(a.point_weights, from);
  point.put(a.to_points, to);
  velocity.put(a.to_velocity, to);
  weights.put(a.to_point_weights, to);
  if (a.source) Row<2, T>(a.source, from).put(a.to_source, to);
}

// Surface point j of member e.
template <class T>
GRANPINN_HD void draw_surface_point(const BatchArguments<T>& a, std::int64_t e, std::int64_t j,
                                    std::int64_t step) {
  const std::int64_t from = drawn_row(a, a.places + 4 * e + 2, a.M, e, kSurfaceStream, j, step);
  const std::int64_t to = e * a.surface + j;
  const Row<3, T> point(a.surface_points, from);
  const Row<1, T> pressure(a.surface_pressure, from);
  point.put(a.to_surface_points, to);
  pressure.put(a.to_surface_pressure, to);
}

// The weights of member e in this step: the control table relaxes the weight of the velocity.
template <class T>
GRANPINN_HD void weigh_terms(const BatchArguments<T>& a, std::int64_t e, std::int64_t step) {
  Row<kTerms, T> weights(a.term_weights, e);
  weights.values[kVelocity] *= static_cast<T>(a.control.row(step)[1 + e]);
  weights.put(a.to_term_weights, e);
}

}  // namespace granpinn
