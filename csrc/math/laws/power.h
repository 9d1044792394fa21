// A power of the inertial number: mu(I) = mu_s + b I^n (da Cruz, Emam, Prochnow, Roux, Chevoir,
// Phys. Rev. E 72, 2005: n = 1; Peyneau and Roux, Phys. Rev. E 78, 2008: n = 0.4).
// I^n = exp(n ln(I + kLeastI)), so that ln I is finite at I = 0.
#pragma once

#include "../scalar.h"

namespace granpinn {

struct Power {
  static constexpr const char* name = "power";
  static constexpr int parameters = 3;  // mu_s, b, n

  template <class R>
  struct Jet {
    using T = scalar_t<R>;
    R b, n, log_I, power;  // power = I^n
    R mu, I_dmu;           // mu, and I mu' = n b I^n

    template <int N>
    GRANPINN_HD Jet(const R& I, const R (&theta)[N]) : b(theta[1]), n(theta[2]) {
      static_assert(N >= parameters, "theta holds all parameters");
      log_I = logarithm(I + R(T(kLeastI)));
      power = exponential(n * log_I);
      mu = theta[0] + b * power;
      I_dmu = n * b * power;
    }

    // I (I mu')'
    GRANPINN_HD R I_d_I_dmu() const { return n * I_dmu; }

    // theta_a, the adjoint of theta, from the adjoint of mu. The rest of theta_a stays.
    template <int N>
    GRANPINN_HD void adjoint(const R& mu_a, R (&theta_a)[N]) const {
      adjoint(mu_a, R(T(0)), theta_a);
    }

    // The same from the adjoints of mu and I mu'.
    template <int N>
    GRANPINN_HD void adjoint(const R& mu_a, const R& I_dmu_a, R (&theta_a)[N]) const {
      static_assert(N >= parameters, "theta_a holds all parameters");
      const R b_a = mu_a + n * I_dmu_a;
      theta_a[0] = mu_a;
      theta_a[1] = power * b_a;
      theta_a[2] = b * power * (log_I * b_a + I_dmu_a);
    }
  };
};

}  // namespace granpinn
