// mu(I) = mu_s + (mu_2 - mu_s) / (1 + I_0 / I)   (Jop, Forterre, Pouliquen, Nature 441, 2006)
#pragma once

#include "../scalar.h"

namespace granpinn {

struct MuOfI {
  static constexpr const char* name = "mu_of_i";
  static constexpr int parameters = 3;  // mu_s, mu_2, I_0

  template <class R>
  struct Jet {  // mu(I) and I mu'(I)
    R mu, I_dmu;
    GRANPINN_HD Jet(const R& I, const R (&theta)[parameters]) {
      const R range = theta[1] - theta[0], over = R(scalar_t<R>(1)) / (theta[2] + I);
      const R ratio = I * over;
      mu = theta[0] + range * ratio;
      I_dmu = range * (ratio * (theta[2] * over));
    }
  };

  template <class R>
  static GRANPINN_HD R friction(const R& I, const R (&theta)[parameters]) {
    return theta[0] + (theta[1] - theta[0]) * (I / (theta[2] + I));
  }
};

}  // namespace granpinn
