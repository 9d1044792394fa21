// The partially regularised mu(I) law (Barker and Gray, J. Fluid Mech. 828, 2017, 5-32):
//   mu(I) = sqrt(alpha / ln(A / I))                                   for I <= I_1,
//   mu(I) = (mu_s I_0 + mu_2 I + mu_inf I^2) / (I_0 + I)              above,
// with A such that mu is continuous at I_1: ln(A / I) = ln(I_1 / I) + alpha / mu(I_1)^2. The slope
// jumps there. The equations are well-posed below I_1, and mu_inf keeps them so at large I.
// Deviation from the source: ln(I + kLeastI) for ln I, so that 1/mu is finite at I = 0.
#pragma once

#include "../scalar.h"

namespace granpinn {

struct Regularised {
  static constexpr const char* name = "regularised";
  static constexpr int parameters = 6;  // mu_s, mu_2, I_0, mu_inf, alpha, I_1

  // With ratio = I / (I_0 + I) and rest = I_0 / (I_0 + I), above I_1:
  //   mu = mu_s rest + (mu_2 + mu_inf I) ratio,
  //   I mu' = ((mu_2 - mu_s) rest + mu_inf I (1 + rest)) ratio.
  // Below, with L = ln(A / I): mu = sqrt(alpha / L), I mu' = mu / (2 L).
  template <class R>
  struct Jet {
    using T = scalar_t<R>;
    using Mask = decltype(less(R(T(0)), R(T(0))));
    R mu_s, mu_2, I_0, mu_inf, alpha, I_1;
    R I, over, ratio, rest;
    R mu_1, over_mu_1, over_L;  // mu(I_1), 1 / mu(I_1), and 1 / L
    Mask slow;                  // I < I_1
    R mu, I_dmu;                // mu, and I mu'

    template <int N>
    GRANPINN_HD Jet(const R& I_, const R (&theta)[N])
        : mu_s(theta[0]),
          mu_2(theta[1]),
          I_0(theta[2]),
          mu_inf(theta[3]),
          alpha(theta[4]),
          I_1(theta[5]),
          I(I_) {
      static_assert(N >= parameters, "theta holds all parameters");
      const R one(T(1));
      over = one / (I_0 + I);
      ratio = I * over;
      rest = I_0 * over;
      mu_1 = (mu_s * I_0 + (mu_2 + mu_inf * I_1) * I_1) / (I_0 + I_1);
      over_mu_1 = one / mu_1;
      slow = less(I, I_1);
      // beyond I_1 the branch is not used, and L stays positive
      const R below = minimum(I, I_1) + R(T(kLeastI));
      over_L = one / (logarithm(I_1 / below) + alpha * over_mu_1 * over_mu_1);
      const R creep = square_root(alpha * over_L);
      mu = select(slow, creep, mu_s * rest + (mu_2 + mu_inf * I) * ratio);
      I_dmu = select(slow, T(0.5) * creep * over_L,
                     ((mu_2 - mu_s) * rest + mu_inf * I * (one + rest)) * ratio);
    }

    // I (I mu')'
    GRANPINN_HD R I_d_I_dmu() const {
      const R more = R(T(1)) + rest;
      return select(
          slow, T(1.5) * I_dmu * over_L,
          ((mu_2 - mu_s) * rest * (rest - ratio) + mu_inf * I * (more * more - ratio * rest)) *
              ratio);
    }

    // theta_a, the adjoint of theta, from the adjoint of mu. The rest of theta_a stays.
    template <int N>
    GRANPINN_HD void adjoint(const R& mu_a, R (&theta_a)[N]) const {
      adjoint(mu_a, R(T(0)), theta_a);
    }

    // The same from the adjoints of mu and I mu'.
    template <int N>
    GRANPINN_HD void adjoint(const R& mu_a, const R& I_dmu_a, R (&theta_a)[N]) const {
      static_assert(N >= parameters, "theta_a holds all parameters");
      const R zero(T(0)), one(T(1));
      // below I_1: the adjoints of L and of mu(I_1)
      const R L_a = -(T(0.5) * mu * over_L * (mu_a + T(1.5) * I_dmu_a * over_L));
      const R mu_1_a = -(T(2) * L_a * alpha * over_mu_1 * over_mu_1 * over_mu_1);
      const R over_1 = one / (I_0 + I_1);
      const R ratio_a = mu_a + I_dmu_a * rest;
      theta_a[0] = select(slow, mu_1_a * I_0 * over_1, rest * (mu_a - I_dmu_a * ratio));
      theta_a[1] = select(slow, mu_1_a * I_1 * over_1, ratio * ratio_a);
      theta_a[2] = select(slow, mu_1_a * (mu_s - mu_1) * over_1,
                          -(ratio * over *
                            ((mu_2 - mu_s) * (mu_a + I_dmu_a * (rest - ratio)) +
                             mu_inf * I * (mu_a + T(2) * I_dmu_a * rest))));
      theta_a[3] = select(slow, mu_1_a * I_1 * I_1 * over_1, I * ratio * (ratio_a + I_dmu_a));
      theta_a[4] = select(
          slow, T(0.5) * (mu * mu_a + I_dmu * I_dmu_a) / alpha + L_a * over_mu_1 * over_mu_1, zero);
      theta_a[5] =
          select(slow, mu_1_a * (mu_2 + T(2) * mu_inf * I_1 - mu_1) * over_1 + L_a / I_1, zero);
    }
  };
};

}  // namespace granpinn
