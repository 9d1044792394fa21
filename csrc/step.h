// One optimization step of E members: plain structs that the kernels of any device read and write.
// Everything lives on the device; the step counter selects the row of the control table.
//
// Order of a step: batch_loss, update, descend. The first fault of a member freezes it: later steps
// do not update it. The caller must undo the update of the faulty step, because its parts before
// the fault have changed the state.
#pragma once

#include <cstdint>

#include "math/adam.h"
#include "math/law_variables.h"
#include "problem.h"

namespace granpinn {

// The quantity that was not finite, in the order of a step.
enum Fault : std::int64_t { kLoss, kGradient, kLawGradient, kParams, kLawScalars };
constexpr std::int64_t kFaults = 8;  // fault[e] = step * kFaults + Fault of the first one
constexpr std::int64_t kHealthy = INT64_MAX;

// For |step| < 2^60. Beyond that it wraps around.
GRANPINN_HD std::int64_t fault_code(std::int64_t step, Fault what) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(step) * kFaults + what);
}
// The next number; the largest one wraps around.
GRANPINN_HD std::int64_t next(std::int64_t a) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) + 1);
}

// The step of the run and its control table. `counter` is (step, step of the table's first row, 0).
// update advances the step; on a GPU, the last number counts the blocks that have read the step.
struct Control {
  std::int64_t* counter;  // [3]
  const double* table;    // [rows, 1 + members]: factor on the learning rates, and on the velocity
                          // term of each member
  std::int64_t rows, members;

  GRANPINN_HD const double* row(std::int64_t step) const {
    const auto last = static_cast<std::uint64_t>(rows - 1);
    const std::uint64_t i =
        static_cast<std::uint64_t>(step) - static_cast<std::uint64_t>(counter[1]);
    return table + (step < counter[1] ? 0 : i < last ? i : last) * (1 + members);
  }
  // The step of the last update.
  GRANPINN_HD std::int64_t updated() const {
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(counter[0]) - 1);
  }
};

// The learning rates and the faults of the members.
struct Members {
  const double* lr_scale;  // [E] factor on every learning rate
  std::int64_t* fault;     // [E]
  std::int64_t* counts;    // [E, 2] updates since a reset: of the network and of the friction law

  // Whether the member had a fault before `what` in this step, or any fault in an earlier one.
  GRANPINN_HD bool frozen(std::int64_t e, std::int64_t step, Fault what) const {
    return fault[e] < fault_code(step, what);
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
  int parameters;                 // the most that a law of a member has
  const std::int64_t* variables;  // [E, parameters] codes of `Variable`
  const double* bounds;           // [E, parameters, 2] of q
  bool moves;
  const T* gradient;              // by theta, [E, parameters] like all below
  T *q, *first, *second, *theta;  // variables, their moments, parameters
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
  LawArguments<T> law;
};

// Whether the loss of member e is finite, and whether its gradient by the friction law is.
struct Sound {
  bool loss, law;
};
template <class T>
GRANPINN_HD Sound sound(const UpdateArguments<T>& a, std::int64_t e) {
  const T* g = a.law.gradient + a.law.parameters * e;
  bool law = true;
  for (int k = 0; k < kMaxLawParameters; ++k) law &= k >= a.law.parameters || finite(g[k]);
  return {finite(a.loss[e]), law};
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
  const T* U;  // [E, count, size], unless the kernel makes it
  T* params;   // [E, P]
};

template <class T>
GRANPINN_HD bool descend(T rate, T U, T* param) {
  const T moved = *param - rate * U;
  const bool good = finite(moved);
  *param = good ? moved : *param;
  return good;
}

// The friction law of member e: its update, and theta for the next step; false if a new value is
// not finite. All loads are issued before any store, so that they overlap.
template <class T>
GRANPINN_HD bool move_law(const UpdateArguments<T>& arguments, std::int64_t e, std::int64_t step) {
  constexpr int N = kMaxLawParameters;
  const LawArguments<T>& a = arguments.law;
  const double factor = arguments.control.row(step)[0] * arguments.members.lr_scale[e];
  std::int64_t* count = arguments.members.counts + 2 * e + 1;
  const std::int64_t t = next(*count), at = a.parameters * e;
  const LawVariables v = law_variables_from(a.parameters, a.variables + at, a.bounds + 2 * at);
  T q[N] = {}, first[N] = {}, second[N] = {}, theta[N] = {}, theta_a[N] = {};
  for (int k = 0; k < N; ++k) {
    if (k >= v.parameters) continue;
    theta[k] = a.theta[at + k];
    theta_a[k] = a.gradient[at + k];
    q[k] = a.q[at + k];
    first[k] = a.first[at + k];
    second[k] = a.second[at + k];
  }
  bool good = true;
  if (a.moves) {
    T q_a[N] = {};
    pull_back(v, q, theta_a, q_a);
    const AdamRates<T> rates = adam_rates<T>(a.adam, factor, t);
    for (int k = 0; k < N; ++k) {
      if (k >= v.parameters || v.kind[k] == Variable::fixed) continue;
      good &= adam(rates, q_a[k], q + k, first + k, second + k);
      q[k] = minimum(maximum(q[k], static_cast<T>(v.low[k])), static_cast<T>(v.high[k]));
    }
    theta_from(v, q, theta);
    *count = t;
  }
  for (int k = 0; k < N; ++k) {
    if (k >= v.parameters) continue;
    a.theta[at + k] = theta[k];
    a.q[at + k] = q[k];
    a.first[at + k] = first[k];
    a.second[at + k] = second[k];
  }
  return good;
}

}  // namespace granpinn
