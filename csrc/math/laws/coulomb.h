// Constant friction (Coulomb): mu = mu_s at every I.
#pragma once

#include "../scalar.h"

namespace granpinn {

struct Coulomb {
  static constexpr const char* name = "coulomb";
  static constexpr int parameters = 1;  // mu_s

  template <class R>
  struct Jet {
    R mu, I_dmu;  // mu, and I mu' = 0

    template <int N>
    GRANPINN_HD Jet(const R&, const R (&theta)[N]) : mu(theta[0]), I_dmu(scalar_t<R>(0)) {}

    // I (I mu')'
    GRANPINN_HD R I_d_I_dmu() const { return I_dmu; }

    // theta_a, the adjoint of theta, from the adjoint of mu. The rest of theta_a stays.
    template <int N>
    GRANPINN_HD void adjoint(const R& mu_a, R (&theta_a)[N]) const {
      theta_a[0] = mu_a;
    }

    // The same from the adjoints of mu and I mu'.
    template <int N>
    GRANPINN_HD void adjoint(const R& mu_a, const R&, R (&theta_a)[N]) const {
      theta_a[0] = mu_a;
    }
  };
};

}  // namespace granpinn
