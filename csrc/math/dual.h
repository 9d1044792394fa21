// Forward-mode differentiation in N directions at once.
//
// A Dual carries a value and its derivatives along N seeded directions: a formula that is evaluated
// with Dual yields its exact derivatives.
#pragma once

#include "scalar.h"

namespace granpinn {

template <class R, int N>
struct Dual {
  using Scalar = scalar_t<R>;

  R value;
  R d[N];

  Dual() = default;
  GRANPINN_HD Dual(Scalar a) : value(a) {
    for (int i = 0; i < N; ++i) d[i] = R(Scalar(0));
  }
  GRANPINN_HD explicit Dual(const R& a, int direction) : value(a) {
    for (int i = 0; i < N; ++i) d[i] = R(Scalar(i == direction ? 1 : 0));
  }

  // f(a) with derivative df: the chain rule
  GRANPINN_HD Dual chain(const R& f, const R& df) const {
    Dual out;
    out.value = f;
    for (int i = 0; i < N; ++i) out.d[i] = df * d[i];
    return out;
  }

  friend GRANPINN_HD Dual operator+(const Dual& a, const Dual& b) {
    Dual out;
    out.value = a.value + b.value;
    for (int i = 0; i < N; ++i) out.d[i] = a.d[i] + b.d[i];
    return out;
  }
  friend GRANPINN_HD Dual operator-(const Dual& a, const Dual& b) {
    Dual out;
    out.value = a.value - b.value;
    for (int i = 0; i < N; ++i) out.d[i] = a.d[i] - b.d[i];
    return out;
  }
  friend GRANPINN_HD Dual operator*(const Dual& a, const Dual& b) {
    Dual out;
    out.value = a.value * b.value;
    for (int i = 0; i < N; ++i) out.d[i] = a.d[i] * b.value + a.value * b.d[i];
    return out;
  }
  friend GRANPINN_HD Dual operator/(const Dual& a, const Dual& b) {
    Dual out;
    out.value = a.value / b.value;
    for (int i = 0; i < N; ++i) out.d[i] = (a.d[i] - out.value * b.d[i]) / b.value;
    return out;
  }
  friend GRANPINN_HD Dual operator-(const Dual& a) { return a.chain(-a.value, R(Scalar(-1))); }

  friend GRANPINN_HD Dual operator+(const Dual& a, Scalar b) {
    return a.chain(a.value + R(b), R(Scalar(1)));
  }
  friend GRANPINN_HD Dual operator-(const Dual& a, Scalar b) { return a + (-b); }
  friend GRANPINN_HD Dual operator*(Scalar b, const Dual& a) {
    return a.chain(R(b) * a.value, R(b));
  }
  friend GRANPINN_HD Dual operator/(Scalar b, const Dual& a) {
    const R f = R(b) / a.value;
    return a.chain(f, -f / a.value);
  }

  friend GRANPINN_HD auto less(const Dual& a, const Dual& b) { return less(a.value, b.value); }
  template <class M>
  friend GRANPINN_HD Dual select(const M& which, const Dual& yes, const Dual& no) {
    Dual out;
    out.value = select(which, yes.value, no.value);
    for (int i = 0; i < N; ++i) out.d[i] = select(which, yes.d[i], no.d[i]);
    return out;
  }

  friend GRANPINN_HD Dual square_root(const Dual& a) {
    const R f = square_root(a.value);
    return a.chain(f, R(Scalar(0.5)) / f);
  }
  friend GRANPINN_HD Dual exponential(const Dual& a) {
    const R f = exponential(a.value);
    return a.chain(f, f);
  }
  friend GRANPINN_HD Dual log_one_plus(const Dual& a) {
    return a.chain(log_one_plus(a.value), R(Scalar(1)) / (R(Scalar(1)) + a.value));
  }
};

}  // namespace granpinn
