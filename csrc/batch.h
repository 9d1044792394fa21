// The batches of E members, drawn from their data: a pure function of (seed, step).
#pragma once

#include "math/philox.h"
#include "step.h"

namespace granpinn {

// Streams of the generator, as in granpinn/training/sampling.py.
constexpr std::uint32_t kInteriorStream = 0, kSurfaceStream = 1;

template <class T>
struct BatchArguments {
  Control control;
  std::int64_t interior, surface;  // points of a member
  std::int64_t share;          // number of this part of a larger batch: starts at share * interior
  const std::int64_t* seeds;   // [E]
  const std::int64_t* places;  // [E, 4]: first point, points; first surface point, their number
  const T* points;             // [N, 3]
  const T* velocity;           // [N, 2]
  const T* point_weights;      // [N, 2]
  const T* surface_points;     // [M, 3]
  const T* surface_pressure;   // [M]
  const T* term_weights;       // [E, kTerms]
  T* to_points;                // [E, interior, 3]
  T* to_velocity;
  T* to_point_weights;
  T* to_surface_points;  // [E, surface, 3]
  T* to_surface_pressure;
  T* to_term_weights;  // [E, kTerms]
};

// Row i of a table: all rows are read before one is stored, so that the loads overlap.
template <int K, class T>
struct Row {
  T values[K];

  GRANPINN_HD Row(const T* from, std::int64_t i) {
    for (int k = 0; k < K; ++k) values[k] = from[K * i + k];
  }
  GRANPINN_HD void put(T* to, std::int64_t j) const {
    for (int k = 0; k < K; ++k) to[K * j + k] = values[k];
  }
};

// Point i of member e.
template <class T>
GRANPINN_HD void draw_point(const BatchArguments<T>& a, std::int64_t e, std::int64_t i,
                            std::int64_t step) {
  const std::int64_t* place = a.places + 4 * e;
  const std::int64_t from =
      place[0] + sample_index(static_cast<std::uint64_t>(a.seeds[e]),
                              static_cast<std::uint64_t>(step), kInteriorStream,
                              static_cast<std::uint32_t>(a.share * a.interior + i),
                              static_cast<std::uint64_t>(place[1]));
  const std::int64_t to = e * a.interior + i;
  const Row<3, T> point(a.points, from);
  const Row<2, T> velocity(a.velocity, from), weights(a.point_weights, from);
  point.put(a.to_points, to);
  velocity.put(a.to_velocity, to);
  weights.put(a.to_point_weights, to);
}

// Surface point j of member e.
template <class T>
GRANPINN_HD void draw_surface_point(const BatchArguments<T>& a, std::int64_t e, std::int64_t j,
                                    std::int64_t step) {
  const std::int64_t* place = a.places + 4 * e;
  const std::int64_t from =
      place[2] + sample_index(static_cast<std::uint64_t>(a.seeds[e]),
                              static_cast<std::uint64_t>(step), kSurfaceStream,
                              static_cast<std::uint32_t>(a.share * a.surface + j),
                              static_cast<std::uint64_t>(place[3]));
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
  weights.values[kVelocity] *= static_cast<T>(a.control.row(step)[2 + e]);
  weights.put(a.to_term_weights, e);
}

}  // namespace granpinn
