// One optimization step of E members in plain structs: what the kernels of any device read and
// write. Everything lives on the device; the step finds its row of the control table by itself.
//
// Order of a step: batch_loss, update, descend. The first fault of a member freezes it: it is not
// updated any more. What its last update leaves, that of the step with the fault, is to be taken
// back: parts that find no fault themselves may have made it.
#pragma once

#include <cstdint>

#include "math/adam.h"
#include "math/law_variables.h"
#include "problem.h"

namespace granpinn {

// What was not finite, in the order in which a step comes across it.
enum Fault : std::int64_t { kLoss, kGradient, kLawGradient, kParams, kLawScalars };
constexpr std::int64_t kFaults = 8;  // fault[e] = step * kFaults + Fault of the first one
constexpr std::int64_t kHealthy = INT64_MAX;

// Where the run is. `counter` is (step, step of the table's first row, 0): update advances the
// step; on a GPU it counts in the last number which of its blocks have read what it changes then.
struct Control {
  std::int64_t* counter;  // [3]
  const double* table;    // [rows, 2 + members]: learning-rate factor, weight of the running
                          // average, factor on each member's velocity term
  std::int64_t rows, members;

  GRANPINN_HD const double* row(std::int64_t step) const {
    const std::int64_t i = step - counter[1];
    return table + (i < 0 ? 0 : i < rows ? i : rows - 1) * (2 + members);
  }
  // The step of the last update.
  GRANPINN_HD std::int64_t updated() const { return counter[0] - 1; }
};

// The learning rates and the faults of the members.
struct Members {
  const double* slower;  // [E] factor on every learning rate
  std::int64_t* fault;   // [E]
  std::int64_t* counts;  // [E, 2] updates since a reset: of the network and of the friction law

  // Whether something before `what` went wrong, in this step or an earlier one.
  GRANPINN_HD bool frozen(std::int64_t e, std::int64_t step, Fault what) const {
    return fault[e] < step * kFaults + what;
  }
};

// A part of the parameters that Muon updates: a matrix.
struct Region {
  std::int64_t begin, size;
};
constexpr int kMaxRegions = 64;

// The friction law of every member.
template <class T>
struct LawArguments {
  AdamSettings adam;
  LawVariables variables;
  bool moves;
  const T* gradient;              // [E, 3] by theta
  T *q, *first, *second, *theta;  // [E, law_numbers], likewise, likewise, [E, 3]
  T* average_q;                   // [E, law_numbers]
};

template <class T>
struct UpdateArguments {
  Control control;
  Members members;
  std::int64_t P;
  AdamSettings adam;
  double momentum;
  int regions;
  Region region[kMaxRegions];  // ascending
  const T* loss;               // [E]
  const T* gradient;           // [E, P]
  T* params;                   // [E, P]
  T* first;                    // [E, P] first moment of Adam, momentum of Muon
  T* second;                   // [E, P]
  T* direction;                // [E, P] Nesterov's gradient, inside the matrices alone
  T* average_params;           // [E, P] running average, outside the matrices alone
  LawArguments<T> law;
};

// Whether the loss of member e is finite, and whether its gradient by the friction law is.
struct Sound {
  bool loss, law;
};
template <class T>
GRANPINN_HD Sound sound(const UpdateArguments<T>& a, std::int64_t e) {
  const T* g = a.law.gradient + 3 * e;
  return {finite(a.loss[e]), finite(g[0]) && finite(g[1]) && finite(g[2])};
}

// The momentum of Muon (Jordan et al., 2024): its mean, and the look ahead.
template <class T>
GRANPINN_HD bool accumulate(T momentum, T gradient, T* first, T* direction) {
  const T B = interpolate(*first, gradient, T(1) - momentum);
  const bool good = finite(B);
  *first = good ? B : *first;
  *direction = interpolate(gradient, *first, momentum);
  return good;
}

// W -= rate U for `count` matrices of a member, `apart` values from one to the next; U is the
// orthogonal factor of a matrix of Nesterov's gradient (cpu/orthogonalize.h).
template <class T>
struct DescendArguments {
  Control control;
  Members members;
  std::int64_t P, offset, count, size, apart;
  double learning_rate;
  const T* U;         // [E, count, size], unless the kernel makes it
  T* params;          // [E, P]
  T* average_params;  // [E, P] running average
};

template <class T>
GRANPINN_HD bool descend(T rate, T U, T* param) {
  const T moved = *param - rate * U;
  const bool good = finite(moved);
  *param = good ? moved : *param;
  return good;
}

// The bounds of log mu_s and of log(mu_2 - mu_s): a wild early step is not final.
constexpr double kLowestLogarithm = -4.605170185988091, kHighestLogarithm = 1.0986122886681098;

// The friction law of member e: its update, its average, and theta for the next step; false where
// something would not be finite. All numbers are read before one is written, so that they can be on
// their way together.
template <class T>
GRANPINN_HD bool move_law(const UpdateArguments<T>& arguments, std::int64_t e, std::int64_t step) {
  const LawArguments<T>& a = arguments.law;
  const double* row = arguments.control.row(step);
  const double factor = row[0] * arguments.members.slower[e];
  const T weight = static_cast<T>(row[1]);
  std::int64_t* count = arguments.members.counts + 2 * e + 1;
  const std::int64_t t = *count + 1;
  const int numbers = law_numbers(a.variables);
  T q[3] = {}, first[3] = {}, second[3] = {}, average[3] = {}, theta[3], grad_theta[3];
  for (int i = 0; i < 3; ++i) {
    theta[i] = a.theta[3 * e + i];
    grad_theta[i] = a.gradient[3 * e + i];
    if (i >= numbers) continue;
    const std::int64_t at = numbers * e + i;
    q[i] = a.q[at];
    first[i] = a.first[at];
    second[i] = a.second[at];
    average[i] = a.average_q[at];
  }
  bool good = true;
  if (a.moves) {
    T grad_q[3] = {};
    law_pull_back(a.variables, q, grad_theta, grad_q);
    const AdamRates<T> rates = adam_rates<T>(a.adam, factor, t);
    for (int i = 0; i < 3; ++i) {
      if (i < numbers) good &= adam(rates, grad_q[i], q + i, first + i, second + i);
      if (a.variables == LawVariables::logarithm)
        q[i] = minimum(maximum(q[i], T(kLowestLogarithm)), T(kHighestLogarithm));
    }
    law_from(a.variables, q, theta);
    *count = t;
  }
  for (int i = 0; i < 3; ++i) {
    a.theta[3 * e + i] = theta[i];
    if (i >= numbers) continue;
    const std::int64_t at = numbers * e + i;
    a.q[at] = q[i];
    a.first[at] = first[i];
    a.second[at] = second[i];
    if (weight > T(0)) a.average_q[at] = interpolate(average[i], q[i], weight);
  }
  return good;
}

}  // namespace granpinn
