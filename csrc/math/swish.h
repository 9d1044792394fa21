// The activation swish(z) = z sigma(z) and its first three derivatives.
//
// With s = sigma(z) and q = s (1 - s):
//   f    = z s
//   f'   = s + z q
//   f''  = q (2 + z (1 - 2 s))
//   f''' = q ((1 - 2 s) (3 + z (1 - 2 s)) - 2 z q)
// Third derivatives enter the gradient of a residual that has second derivatives.
#pragma once

#include "scalar.h"

namespace granpinn {

template <class R>
struct Swish {
  R f, f1, f2, f3;
};

// `Derivatives` 1 .. 3: number of derivatives to compute; the others are left unset.
template <int Derivatives, class R>
GRANPINN_HD Swish<R> swish(const R& z) {
  using T = scalar_t<R>;
  const R one(T(1));
  const R s = logistic(z);
  const R q = s * (one - s);
  Swish<R> out;
  out.f = z * s;
  out.f1 = s + z * q;
  if constexpr (Derivatives >= 2) {
    const R r = one - s - s;
    out.f2 = q * (R(T(2)) + z * r);
    if constexpr (Derivatives >= 3) out.f3 = q * (r * (R(T(3)) + z * r) - (z + z) * q);
  }
  return out;
}

}  // namespace granpinn
