// The parameters theta of a friction law as unbounded numbers q, which an optimiser moves
// (granpinn/physics/laws/law.py):
//   fixed            theta_k is constant
//   logarithm        theta_k = exp(q_k)
//   logarithm_above  theta_k = theta_(k-1) + exp(q_k)
//   logistic         theta_k = 1 / (1 + exp(-q_k))
#pragma once

#include "laws/laws.h"

namespace granpinn {

enum class Variable { fixed, logarithm, logarithm_above, logistic };
constexpr int kVariables = 4;

struct LawVariables {
  int parameters;
  Variable kind[kMaxLawParameters];
  double low[kMaxLawParameters], high[kMaxLawParameters];  // bounds of q
};

// theta at q; a fixed parameter keeps its value.
template <class T>
GRANPINN_HD void theta_from(const LawVariables& v, const T* q, T* theta) {
  for (int k = 0; k < kMaxLawParameters; ++k) {
    if (k >= v.parameters) continue;
    if (v.kind[k] == Variable::logarithm) theta[k] = exponential(q[k]);
    if (v.kind[k] == Variable::logarithm_above && k > 0)
      theta[k] = theta[k - 1] + exponential(q[k]);
    if (v.kind[k] == Variable::logistic) theta[k] = T(1) / (T(1) + exponential(-q[k]));
  }
}

// d loss / d q from d loss / d theta; 0 for a fixed parameter. Changes theta_a: theta_(k-1) adds up
// the adjoints of the parameters that depend on it.
template <class T>
GRANPINN_HD void pull_back(const LawVariables& v, const T* q, T* theta_a, T* q_a) {
  for (int k = kMaxLawParameters - 1; k >= 0; --k) {
    q_a[k] = T(0);
    if (k >= v.parameters) continue;
    if (v.kind[k] == Variable::logarithm) q_a[k] = exponential(q[k]) * theta_a[k];
    if (v.kind[k] == Variable::logarithm_above && k > 0) {
      q_a[k] = exponential(q[k]) * theta_a[k];
      theta_a[k - 1] += theta_a[k];
    }
    if (v.kind[k] == Variable::logistic) {
      const T theta = T(1) / (T(1) + exponential(-q[k]));
      q_a[k] = theta * (T(1) - theta) * theta_a[k];
    }
  }
}

}  // namespace granpinn
