// The gradient of a point's weighted squared residuals, exact, by forward differentiation.
#pragma once

#include "dual.h"
#include "mixed_form.h"
#include "strong_form.h"

namespace granpinn {

// Which loss term a residual of a form belongs to.
GRANPINN_HD int term_of(int residual) { return residual < 2 ? 2 : residual == 2 ? 3 : 4; }

// The inputs of a form in one row: raw jets by field and channel, then mu_s, mu_2, I0.
template <class F>
constexpr int kInputs = F::fields * F::channels + 3;

// From raw jets z and weights w (one per residual): the residuals e, and the derivatives of
// sum_r w_r e_r^2 / 2 by the inputs first .. first + W - 1 (0 beyond the last).
template <class F, int W, class R, class T>
GRANPINN_HD void form_derivatives(int first, const R (&z)[F::fields][F::channels],
                                  const FrictionLaw<R>& law, const Physics<T>& c,
                                  const R (&w)[F::residuals], R (&e)[F::residuals], R (&g)[W]) {
  constexpr int jets = F::fields * F::channels;
  using D = Dual<R, W>;
  D zd[F::fields][F::channels], ed[F::residuals];
  for (int i = 0; i < jets; ++i)
    zd[i / F::channels][i % F::channels] = D(z[i / F::channels][i % F::channels], i - first);
  const FrictionLaw<D> law_d{D(law.mu_s, jets - first), D(law.mu_2, jets + 1 - first),
                             D(law.I0, jets + 2 - first)};
  F::evaluate(zd, law_d, c, ed);
  for (int i = 0; i < W; ++i) {
    g[i] = w[0] * ed[0].value * ed[0].d[i];
    for (int r = 1; r < F::residuals; ++r) g[i] = g[i] + w[r] * ed[r].value * ed[r].d[i];
  }
  for (int r = 0; r < F::residuals; ++r) e[r] = ed[r].value;
}

// All derivatives by one thread, in chunks of four: that keeps a Dual within the registers.
template <class F, class R, class T>
GRANPINN_HD void form_gradient(const R (&z)[F::fields][F::channels], const FrictionLaw<R>& law,
                               const Physics<T>& c, const R (&w)[F::residuals],
                               R (&e)[F::residuals], R (&g)[F::fields][F::channels],
                               R (&g_law)[3]) {
  constexpr int W = 4, jets = F::fields * F::channels;
  for (int first = 0; first < kInputs<F>; first += W) {
    R part[W];
    form_derivatives<F>(first, z, law, c, w, e, part);
    for (int i = 0; i < W && first + i < kInputs<F>; ++i) {
      const int at = first + i;
      if (at < jets)
        g[at / F::channels][at % F::channels] = part[i];
      else
        g_law[at - jets] = part[i];
    }
  }
}

}  // namespace granpinn
