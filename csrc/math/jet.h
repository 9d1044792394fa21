// Jets: a quantity with its derivatives with respect to (x, y, t), pushed through an activation.
//
// A jet of C channels holds, in this order,
//   C = 1: value        C = 4: value, x, y, t        C = 7: value, x, y, t, xx, xy, yy.
// For a = f(z):  a_i = f' z_i,  a_ij = f'' z_i z_j + f' z_ij  (Faa di Bruno).
#pragma once

#include "swish.h"

namespace granpinn {

enum Channel { kValue, kX, kY, kT, kXX, kXY, kYY };

template <int C, class R>
GRANPINN_HD void activation_jet(const R (&z)[C], R (&a)[C]) {
  static_assert(C == 1 || C == 4 || C == 7, "jets have 1, 4 or 7 channels");
  const Swish<R> s = swish<(C == 7 ? 2 : 1)>(z[kValue]);
  a[kValue] = s.f;
  for (int i = 1; i < (C < 4 ? C : 4); ++i) a[i] = s.f1 * z[i];
  if constexpr (C == 7) {
    a[kXX] = s.f2 * (z[kX] * z[kX]) + s.f1 * z[kXX];
    a[kXY] = s.f2 * (z[kX] * z[kY]) + s.f1 * z[kXY];
    a[kYY] = s.f2 * (z[kY] * z[kY]) + s.f1 * z[kYY];
  }
}

// The adjoint of activation_jet: from z and g = dL/da, in one go, the activation itself (`a`,
// needed for the weights' gradient) and dL/dz (`g`, overwritten).
template <int C, class R>
GRANPINN_HD void activation_jet_adjoint(const R (&z)[C], R (&a)[C], R (&g)[C]) {
  using T = scalar_t<R>;
  const Swish<R> s = swish<(C == 7 ? 3 : C == 4 ? 2 : 1)>(z[kValue]);
  a[kValue] = s.f;
  R gv = s.f1 * g[kValue];
  if constexpr (C >= 4) {
    const R first = z[kX] * g[kX] + z[kY] * g[kY] + z[kT] * g[kT];
    gv = gv + s.f2 * first;
    for (int i = 1; i < 4; ++i) a[i] = s.f1 * z[i];
  }
  if constexpr (C == 7) {
    const R xx = z[kX] * z[kX], xy = z[kX] * z[kY], yy = z[kY] * z[kY];
    a[kXX] = s.f2 * xx + s.f1 * z[kXX];
    a[kXY] = s.f2 * xy + s.f1 * z[kXY];
    a[kYY] = s.f2 * yy + s.f1 * z[kYY];
    gv = gv + s.f3 * (xx * g[kXX] + xy * g[kXY] + yy * g[kYY]);
    gv = gv + s.f2 * (z[kXX] * g[kXX] + z[kXY] * g[kXY] + z[kYY] * g[kYY]);
    const R two(T(2));
    const R gx = s.f1 * g[kX] + s.f2 * (two * z[kX] * g[kXX] + z[kY] * g[kXY]);
    const R gy = s.f1 * g[kY] + s.f2 * (two * z[kY] * g[kYY] + z[kX] * g[kXY]);
    g[kX] = gx;
    g[kY] = gy;
    g[kT] = s.f1 * g[kT];
    for (int i = kXX; i <= kYY; ++i) g[i] = s.f1 * g[i];
  } else if constexpr (C == 4) {
    for (int i = 1; i < 4; ++i) g[i] = s.f1 * g[i];
  }
  g[kValue] = gv;
}

}  // namespace granpinn
