// The gradient of a point's weighted squared residuals, exact, by forward differentiation.
#pragma once

#include "math/dual.h"
#include "math/mixed_form.h"
#include "math/strong_form.h"

namespace granpinn {

// From raw jets z and weights w (one per residual): the residuals e, and the gradient of
// sum_r w_r e_r^2 / 2 with respect to z and to (mu_s, mu_2, I0). Derivatives are taken in chunks
// of four directions, which keeps a Dual within the registers.
template <class F, class R, class T>
GRANPINN_HD void form_gradient(const R (&z)[F::fields][F::channels], const FrictionLaw<R>& law,
                               const Physics<T>& c, const R (&w)[F::residuals],
                               R (&e)[F::residuals], R (&g)[F::fields][F::channels],
                               R (&g_law)[3]) {
  constexpr int W = 4;
  constexpr int inputs = F::fields * F::channels;
  using D = Dual<R, W>;
  for (int first = 0; first < inputs + 3; first += W) {
    D zd[F::fields][F::channels], ed[F::residuals];
    for (int i = 0; i < inputs; ++i)
      zd[i / F::channels][i % F::channels] = D(z[i / F::channels][i % F::channels], i - first);
    const FrictionLaw<D> law_d{D(law.mu_s, inputs - first), D(law.mu_2, inputs + 1 - first),
                               D(law.I0, inputs + 2 - first)};
    F::evaluate(zd, law_d, c, ed);
    for (int i = 0; i < W && first + i < inputs + 3; ++i) {
      R sum = w[0] * ed[0].value * ed[0].d[i];
      for (int r = 1; r < F::residuals; ++r) sum = sum + w[r] * ed[r].value * ed[r].d[i];
      const int at = first + i;
      if (at < inputs)
        g[at / F::channels][at % F::channels] = sum;
      else
        g_law[at - inputs] = sum;
    }
    for (int r = 0; r < F::residuals; ++r) e[r] = ed[r].value;
  }
}

}  // namespace granpinn
