// Cohesive grains (Mohr-Coulomb with mu(I)): the yield stress is c + mu(I) p, with mu(I) as in
// mu_of_i.h and the cohesion c >= 0, a stress. math/cohesion.h has the sum.
#pragma once

#include "mu_of_i.h"

namespace granpinn {

struct Cohesive {
  static constexpr const char* name = "cohesive";
  static constexpr int parameters = 4;  // mu_s, mu_2, I_0, c
  static constexpr int cohesion = 3;    // the place of c

  // mu(I) without c.
  template <class R>
  using Jet = typename MuOfI::template Jet<R>;
};

}  // namespace granpinn
