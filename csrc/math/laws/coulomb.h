// mu = mu_s at every I   (Coulomb)
#pragma once

#include "../scalar.h"

namespace granpinn {

struct Coulomb {
  static constexpr const char* name = "coulomb";
  static constexpr int parameters = 1;  // mu_s

  template <class R>
  struct Jet {  // mu(I) and I mu'(I)
    R mu, I_dmu;
    GRANPINN_HD Jet(const R&, const R (&theta)[parameters]) : mu(theta[0]), I_dmu(scalar_t<R>(0)) {}
  };

  template <class R>
  static GRANPINN_HD R friction(const R&, const R (&theta)[parameters]) {
    return theta[0];
  }
};

}  // namespace granpinn
