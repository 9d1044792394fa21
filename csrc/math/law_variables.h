// The parameters theta of a friction law as unbounded numbers q, which an optimiser moves
// (granpinn/physics/laws/law.py):
//   fixed            theta_k is constant
//   logarithm        theta_k = exp(q_k)
//   logarithm_above  theta_k = theta_(k-1) + exp(q_k)
//   logistic         theta_k = 1 / (1 + exp(-q_k))
#pragma once

#include <cstdint>

#include "laws/laws.h"

namespace granpinn {

enum class Variable { fixed, logarithm, logarithm_above, logistic };
constexpr int kVariables = 4;

struct LawVariables {
  int parameters;
  Variable kind[kMaxLawParameters];
  double low[kMaxLawParameters], high[kMaxLawParameters];  // bounds of q
};

// From a code of `Variable` and the bounds (low, high) for each parameter. Any other code is fixed.
GRANPINN_HD LawVariables law_variables_from(int parameters, const std::int64_t* codes,
                                            const double* bounds) {
  LawVariables v{};
  v.parameters = parameters;
  for (int k = 0; k < kMaxLawParameters; ++k) {
    if (k >= parameters) continue;
    const std::int64_t code = codes[k];
    v.kind[k] = code > 0 && code < kVariables ? static_cast<Variable>(code) : Variable::fixed;
    v.low[k] = bounds[2 * k];
    v.high[k] = bounds[2 * k + 1];
  }
  return v;
}

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
