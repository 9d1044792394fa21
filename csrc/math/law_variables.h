// The unknowns mu_s and mu_2 as two unbounded numbers q (granpinn/training/scalars.py):
//   log:      mu_s = exp(q_0), mu_2 = exp(q_0) + exp(q_1)
//   sigmoid:  mu_s = 1 / (1 + exp(-q_0)), mu_2 = 1 / (1 + exp(-q_1))
// or, to compare with optimizers that know of no such thing, all three numbers of theta themselves.
#pragma once

#include "scalar.h"

namespace granpinn {

enum class LawVariables { logarithm, sigmoid, theta };

// How many there are.
GRANPINN_HD constexpr int law_numbers(LawVariables kind) {
  return kind == LawVariables::theta ? 3 : 2;
}

// theta = (mu_s, mu_2, I0); I0 stays, unless it is a variable.
template <class T>
GRANPINN_HD void law_from(LawVariables kind, const T* q, T* theta) {
  if (kind == LawVariables::logarithm) {
    theta[0] = exponential(q[0]);
    theta[1] = theta[0] + exponential(q[1]);
  } else if (kind == LawVariables::theta) {
    for (int i = 0; i < 3; ++i) theta[i] = q[i];
  } else {
    for (int i = 0; i < 2; ++i) theta[i] = T(1) / (T(1) + exponential(-q[i]));
  }
}

// d loss / d q from d loss / d theta
template <class T>
GRANPINN_HD void law_pull_back(LawVariables kind, const T* q, const T* grad_theta, T* grad_q) {
  if (kind == LawVariables::logarithm) {
    grad_q[0] = exponential(q[0]) * (grad_theta[0] + grad_theta[1]);
    grad_q[1] = exponential(q[1]) * grad_theta[1];
  } else if (kind == LawVariables::theta) {
    for (int i = 0; i < 3; ++i) grad_q[i] = grad_theta[i];
  } else {
    for (int i = 0; i < 2; ++i) {
      const T mu = T(1) / (T(1) + exponential(-q[i]));
      grad_q[i] = mu * (T(1) - mu) * grad_theta[i];
    }
  }
}

}  // namespace granpinn
