// The force on the grains at a point, per mass: gravity and, where a problem has one, the source
// term S(x, y, t) of the momentum equation. A source makes any given motion a solution
// (bench/studies/floor). It is a constant for all gradients.
#pragma once

#include <cstdint>

#include "physics.h"

namespace granpinn {

template <class R>
struct BodyForce {
  R x, y;
};

// The force at point i; `source` is [n, 2], or null without one.
template <class T>
GRANPINN_HD BodyForce<T> body_force(const Physics<T>& c, const T* source, std::int64_t i) {
  if (!source) return {c.g_x, c.g_y};
  return {c.g_x + source[2 * i], c.g_y + source[2 * i + 1]};
}

}  // namespace granpinn
