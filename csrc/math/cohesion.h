// Cohesion: a law with the member `cohesion`, the place of c in theta, has the yield stress
//   Y = c + mu(I) p.
// All other laws have Y = mu(I) p. Nothing is computed for them here, so that their results do not
// change in any bit.
#pragma once

#include "scalar.h"

namespace granpinn {

template <class Law, class = int>
constexpr bool is_cohesive = false;
template <class Law>
constexpr bool is_cohesive<Law, decltype(Law::cohesion + 0)> = true;

// The yield stress Y.
template <class Law, class R, int N>
GRANPINN_HD R yield_stress(const R& mu, const R& p, const R (&theta)[N]) {
  if constexpr (is_cohesive<Law>)
    return mu * p + theta[Law::cohesion];
  else
    return mu * p;
}

// p / Y, which is 1 / mu without cohesion. It is 0 at p = 0 of cohesive grains.
template <class Law, class R>
struct OverFriction {
  R yield;  // 1 / Y; of other laws 1 / mu
  R mu;     // p / Y

  template <int N>
  GRANPINN_HD OverFriction(const R& mu_of_I, const R& p, const R (&theta)[N]) {
    const R one(scalar_t<R>(1));
    if constexpr (is_cohesive<Law>) {
      yield = one / yield_stress<Law>(mu_of_I, p, theta);
      mu = p * yield;
    } else {
      yield = mu = one / mu_of_I;
    }
  }
};

}  // namespace granpinn
