// The mu(I) law (Jop, Forterre, Pouliquen, Nature 2006; paper, eq. muI):
//   mu(I) = mu_s + (mu_2 - mu_s) / (1 + I_0 / I).
#pragma once

#include "../scalar.h"

namespace granpinn {

struct MuOfI {
  static constexpr const char* name = "mu_of_i";
  static constexpr int parameters = 3;  // mu_s, mu_2, I_0

  // The law at one inertial number. With ratio = I / (I_0 + I) and rest = I_0 / (I_0 + I):
  // mu = mu_s + range ratio, I mu' = range ratio rest.
  template <class R>
  struct Jet {
    R range, over, ratio, rest;  // mu_2 - mu_s, 1 / (I_0 + I), and see above
    R mu, I_dmu;

    // theta may be longer than the law's parameters.
    template <int N>
    GRANPINN_HD Jet(const R& I, const R (&theta)[N]) {
      static_assert(N >= parameters, "theta holds all parameters");
      const R &mu_s = theta[0], &mu_2 = theta[1], &I_0 = theta[2];
      range = mu_2 - mu_s;
      over = R(scalar_t<R>(1)) / (I_0 + I);
      ratio = I * over;
      rest = I_0 * over;
      mu = mu_s + range * ratio;
      I_dmu = range * (ratio * rest);
    }

    // I (I mu')'
    GRANPINN_HD R I_d_I_dmu() const { return I_dmu * (rest - ratio); }

    // theta_a, the adjoint of theta, from the adjoint of mu. The rest of theta_a stays.
    template <int N>
    GRANPINN_HD void adjoint(const R& mu_a, R (&theta_a)[N]) const {
      static_assert(N >= parameters, "theta_a holds all parameters");
      theta_a[0] = mu_a * rest;
      theta_a[1] = mu_a * ratio;
      theta_a[2] = -(mu_a * range * over * ratio);
    }

    // The same from the adjoints of mu and I mu'.
    template <int N>
    GRANPINN_HD void adjoint(const R& mu_a, const R& I_dmu_a, R (&theta_a)[N]) const {
      static_assert(N >= parameters, "theta_a holds all parameters");
      theta_a[0] = rest * (mu_a - I_dmu_a * ratio);
      theta_a[1] = ratio * (mu_a + I_dmu_a * rest);
      theta_a[2] = -(range * ratio * over * (mu_a + I_dmu_a * (rest - ratio)));
    }
  };
};

}  // namespace granpinn
