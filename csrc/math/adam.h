// Adam (Kingma & Ba, 2015) and the running means around it, element by element.
#pragma once

#include <cmath>
#include <cstdint>

#include "scalar.h"

namespace granpinn {

template <class T>
GRANPINN_HD bool finite(T a) {
  return a - a == T(0);
}

// a + w (b - a), exact at both ends because it starts from the closer one.
template <class T>
GRANPINN_HD T interpolate(T a, T b, T w) {
  return w < T(0.5) ? a + w * (b - a) : b - (b - a) * (T(1) - w);
}

struct AdamSettings {
  double learning_rate, beta_1, beta_2, epsilon;
};

// Numbers that the elements of one update share.
template <class T>
struct AdamRates {
  T step_size;   // learning rate / (1 - beta_1^t)
  T root_scale;  // sqrt(1 - beta_2^t)
  T gain_1;      // 1 - beta_1
  T beta_2, gain_2;
  T epsilon;
};

// `t` counts from 1; `factor` scales the learning rate. The powers are made by squaring, with the
// same bits on every device. Their relative error is at most t / 2^53; they are small for large t.
template <class T>
GRANPINN_HD AdamRates<T> adam_rates(const AdamSettings& s, double factor, std::int64_t t) {
  double power_1 = 1, power_2 = 1, square_1 = s.beta_1, square_2 = s.beta_2;
  for (auto left = static_cast<std::uint64_t>(t); left > 0; left /= 2) {
    power_1 *= left % 2 != 0 ? square_1 : 1.0;
    power_2 *= left % 2 != 0 ? square_2 : 1.0;
    square_1 *= square_1;
    square_2 *= square_2;
  }
  return {static_cast<T>(factor * s.learning_rate / (1 - power_1)),
          static_cast<T>(sqrt(1 - power_2)),
          static_cast<T>(1 - s.beta_1),
          static_cast<T>(s.beta_2),
          static_cast<T>(1 - s.beta_2),
          static_cast<T>(s.epsilon)};
}

// Updates one element; false if a new value is not finite: the element then keeps its old value.
template <class T>
GRANPINN_HD bool adam(const AdamRates<T>& r, T gradient, T* param, T* first, T* second) {
  const T m = interpolate(*first, gradient, r.gain_1);
  const T v = r.beta_2 * *second + r.gain_2 * gradient * gradient;
  const T moved = *param - r.step_size * m / (square_root(v) / r.root_scale + r.epsilon);
  const bool good = finite(v) && finite(m) && finite(moved);
  *first = good ? m : *first;
  *second = good ? v : *second;
  *param = good ? moved : *param;
  return good;
}

}  // namespace granpinn
