// The functions that the shared mathematics needs of a real number type.
//
// Every function of csrc/math is a template over a real type R: float or double (host and
// device), or Vec<T> (cpu/simd.h). R provides + - * /, comparison by `less`, `select`, and the
// elementary functions below, found by argument-dependent lookup.
#pragma once

#include <cmath>

#if defined(__CUDACC__)
#define GRANPINN_HD __host__ __device__ __forceinline__
#else
#define GRANPINN_HD inline __attribute__((always_inline))
#endif

namespace granpinn {

// the plain scalar under a real type: float or double
template <class R>
struct ScalarOf {
  using type = typename R::Scalar;
};
template <>
struct ScalarOf<float> {
  using type = float;
};
template <>
struct ScalarOf<double> {
  using type = double;
};
template <class R>
using scalar_t = typename ScalarOf<R>::type;

GRANPINN_HD float exponential(float a) { return expf(a); }
GRANPINN_HD double exponential(double a) { return ::exp(a); }
GRANPINN_HD float square_root(float a) { return sqrtf(a); }
GRANPINN_HD double square_root(double a) { return ::sqrt(a); }
GRANPINN_HD float logarithm(float a) { return logf(a); }
GRANPINN_HD double logarithm(double a) { return ::log(a); }
GRANPINN_HD float log_one_plus(float a) { return log1pf(a); }
GRANPINN_HD double log_one_plus(double a) { return ::log1p(a); }

GRANPINN_HD bool less(float a, float b) { return a < b; }
GRANPINN_HD bool less(double a, double b) { return a < b; }
GRANPINN_HD float select(bool which, float yes, float no) { return which ? yes : no; }
GRANPINN_HD double select(bool which, double yes, double no) { return which ? yes : no; }

// Added to an inertial number of which the logarithm is taken.
constexpr double kLeastI = 1e-30;

// 1 / (1 + exp(-a))
template <class R>
GRANPINN_HD R logistic(const R& a) {
  const R one(scalar_t<R>(1));
  return one / (one + exponential(-a));
}
#if defined(__CUDA_ARCH__)
// Without the branches of a division: an estimate and a step of Newton's, as accurate. The bound
// on the exponent keeps the estimate from 0 (and the step from a NaN) where the result is 0.
GRANPINN_HD float logistic(const float& a) {
  const float b = 1 + expf(fminf(-a, 80.0f));
  float r;
  asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(r) : "f"(b));
  return fmaf(r, fmaf(-b, r, 1.0f), r);
}
#endif

template <class R>
GRANPINN_HD R absolute(R a) {
  return select(less(a, R(scalar_t<R>(0))), -a, a);
}

template <class R>
GRANPINN_HD R maximum(R a, R b) {
  return select(less(a, b), b, a);
}

template <class R>
GRANPINN_HD R minimum(R a, R b) {
  return select(less(b, a), b, a);
}

}  // namespace granpinn
