// A free curve: mu is a uniform cubic B-spline of ln I with the coefficients c_1 .. c_8 between
// I_low and I_high, and constant beyond (de Boor, A Practical Guide to Splines, 2001).
//   x  = 5 ln(I / I_low) / ln(I_high / I_low), within 0 .. 5
//   mu = sum_k c_k B(x + 2 - k),  6 B(r) = (2 - |r|)_+^3 - 4 (1 - |r|)_+^3
// mu has two continuous derivatives between the ends. I mu' jumps to 0 at the ends.
#pragma once

#include "../scalar.h"

namespace granpinn {

struct Free {
  static constexpr const char* name = "free";
  static constexpr int coefficients = 8, parameters = 10;  // c_1 .. c_8, I_low, I_high
  static constexpr int intervals = coefficients - 3;

  template <class R>
  struct Jet {
    using T = scalar_t<R>;
    R x, slope;                        // slope = dx / d ln I, 0 beyond the ends
    R mu, I_dmu, by_x;                 // mu, I mu', and dmu / dx
    R over_low, over_high, over_span;  // 1 / I_low, 1 / I_high, 1 / ln(I_high / I_low)
    R second;                          // d2 mu / dx2, 0 beyond the ends

    template <int N>
    GRANPINN_HD Jet(const R& I, const R (&theta)[N]) {
      static_assert(N >= parameters, "theta holds all parameters");
      const R zero = T(0), top = T(intervals), one = T(1);
      const R &I_low = theta[coefficients], &I_high = theta[coefficients + 1];
      over_low = one / I_low;
      over_high = one / I_high;
      over_span = one / logarithm(I_high * over_low);
      const R free_x = top * logarithm(I * over_low + R(T(kLeastI))) * over_span;
      x = minimum(maximum(free_x, zero), top);
      slope = select(less(zero, free_x), select(less(free_x, top), top * over_span, zero), zero);
      mu = by_x = second = zero;
      for (int k = 0; k < coefficients; ++k) {
        const R r = x + R(T(1 - k)), wide = outside(r, T(2)), narrow = outside(r, T(1));
        mu = mu + theta[k] * value(wide, narrow);
        by_x = by_x + theta[k] * derivative(r, wide, narrow);
        second = second + theta[k] * (wide - T(4) * narrow);
      }
      I_dmu = slope * by_x;
    }

    // I (I mu')'
    GRANPINN_HD R I_d_I_dmu() const { return slope * slope * second; }

    // theta_a, the adjoint of theta, from the adjoint of mu. The rest of theta_a stays.
    template <int N>
    GRANPINN_HD void adjoint(const R& mu_a, R (&theta_a)[N]) const {
      adjoint(mu_a, R(T(0)), theta_a);
    }

    // The same from the adjoints of mu and I mu'.
    template <int N>
    GRANPINN_HD void adjoint(const R& mu_a, const R& I_dmu_a, R (&theta_a)[N]) const {
      static_assert(N >= parameters, "theta_a holds all parameters");
      const R by_x_a = I_dmu_a * slope;
      for (int k = 0; k < coefficients; ++k) {
        const R r = x + R(T(1 - k)), wide = outside(r, T(2)), narrow = outside(r, T(1));
        theta_a[k] = mu_a * value(wide, narrow) + by_x_a * derivative(r, wide, narrow);
      }
      // x = slope ln(I / I_low), slope = 5 / ln(I_high / I_low)
      const R x_a = slope * (mu_a * by_x + by_x_a * second);
      const R stretch_a = (x_a * x * (R(T(1)) / T(intervals)) + I_dmu_a * I_dmu * over_span);
      theta_a[coefficients] = over_low * (stretch_a - x_a);
      theta_a[coefficients + 1] = -(over_high * stretch_a);
    }

   private:
    // (width - |r|)_+
    static GRANPINN_HD R outside(const R& r, T width) {
      return maximum(R(width) - absolute(r), R(T(0)));
    }
    static GRANPINN_HD R value(const R& wide, const R& narrow) {
      return T(1) / T(6) * (wide * wide * wide - T(4) * (narrow * narrow * narrow));
    }
    static GRANPINN_HD R derivative(const R& r, const R& wide, const R& narrow) {
      const R half = T(0.5) * (wide * wide) - T(2) * (narrow * narrow);
      return select(less(r, R(T(0))), half, -half);
    }
  };
};

}  // namespace granpinn
