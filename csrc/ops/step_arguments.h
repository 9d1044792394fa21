// The arguments that the operators of a step share, checked: tensors used in place, control, rates.
#pragma once

#include <utility>
#include <vector>

#include "../batch.h"
#include "arguments.h"

namespace granpinn {

// The tensors of an operator that works in place, all on the device of `like`.
class InPlace {
 public:
  explicit InPlace(const at::Tensor& like) : like_(like) { spans_.reserve(32); }

  // Checks a tensor that the operator reads: its type, shape and device, and that it has no gaps.
  void reads(const char* name, const at::Tensor& a, at::ScalarType type,
             std::vector<std::int64_t> shape) {
    const at::IntArrayRef expected(shape);
    GRANPINN_CHECK_TYPE(a.scalar_type() == type && a.device() == like_.device(), name, " must be ",
                        c10::toString(type), " on ", like_.device().str(), ", got ", shape_of(a));
    GRANPINN_CHECK_VALUE(a.sizes() == expected && a.is_contiguous(), name, " must be ", expected,
                         " and contiguous, got ", shape_of(a));
    spans(name, a, false);
  }

  // Checks a tensor that the operator changes.
  void changes(const char* name, const at::Tensor& a, at::ScalarType type,
               std::vector<std::int64_t> shape) {
    reads(name, a, type, std::move(shape));
    spans_.back().changed = true;
  }

  // The memory from the first to the last element of a tensor, with gaps or without.
  void spans(const char* name, const at::Tensor& a, bool changed) {
    GRANPINN_CHECK_VALUE(!a.is_neg(), name, " must not be a negated view: pass a clone of it");
    std::int64_t bytes = 0;
    if (a.numel() > 0) {
      bytes = 1;
      for (std::int64_t i = 0; i < a.dim(); ++i)
        bytes = checked_add(bytes, checked_mul(a.size(i) - 1, a.stride(i)));
      bytes = checked_mul(bytes, a.element_size());
    }
    const auto* begin = static_cast<const char*>(a.const_data_ptr());
    spans_.push_back({name, begin, begin + bytes, changed});
  }

  // Refuses a tensor that the operator changes and that shares memory with another.
  void are_apart() const {
    for (const Span& a : spans_)
      for (const Span& b : spans_)
        GRANPINN_CHECK_VALUE(
            !a.changed || &a == &b || a.begin >= b.end || b.begin >= a.end || a.begin == a.end,
            a.name, " must not share memory with ", b.name, ": pass a clone of one of them");
  }

 private:
  struct Span {
    const char* name;
    const char *begin, *end;
    bool changed;
  };
  const at::Tensor& like_;
  std::vector<Span> spans_;
};

// The step counter and its table; `moves`: the operator advances the counter.
inline Control control_of(InPlace& in, const at::Tensor& counter, const at::Tensor& table,
                          std::int64_t E, bool moves) {
  moves ? in.changes("counter", counter, at::kLong, {3})
        : in.reads("counter", counter, at::kLong, {3});
  const std::int64_t columns = checked_add(1, E), rows = table.dim() == 2 ? table.size(0) : 0;
  GRANPINN_CHECK_VALUE(rows >= 1, "table must be [rows, ", columns, "] with at least one row, got ",
                       shape_of(table));
  in.reads("table", table, at::kDouble, {rows, columns});
  return {counter.mutable_data_ptr<std::int64_t>(), table.const_data_ptr<double>(), rows, E};
}

// Learning rates, faults and counts of the members; `counts_move`: the operator advances them too.
inline Members members_of(InPlace& in, const at::Tensor& lr_scale, const at::Tensor& fault,
                          const at::Tensor& counts, std::int64_t E, bool counts_move) {
  in.reads("lr_scale", lr_scale, at::kDouble, {E});
  in.changes("fault", fault, at::kLong, {E});
  counts_move ? in.changes("counts", counts, at::kLong, {E, 2})
              : in.reads("counts", counts, at::kLong, {E, 2});
  return {lr_scale.const_data_ptr<double>(), fault.mutable_data_ptr<std::int64_t>(),
          counts.mutable_data_ptr<std::int64_t>()};
}

// A fault code has 61 bits for the step. On a GPU the counter is not read here: wrong steps give
// wrong codes there, and a wrong count of blocks delays the step.
inline void check_step(const Control& control, const at::Tensor& counter) {
  if (!counter.is_cpu()) return;
  GRANPINN_CHECK_VALUE(control.counter[0] >= 0 && control.counter[0] < kHealthy / kFaults,
                       "the step must be in 0..2^60 - 2, got ", control.counter[0]);
  GRANPINN_CHECK_VALUE(control.counter[2] == 0, "the last number of counter must be 0, got ",
                       control.counter[2]);
}

// Refuses places outside of `rows` rows, on a CPU. On a GPU draw_point gives NaN for them.
inline void check_places(const char* name, const at::Tensor& places, int column,
                         std::int64_t rows) {
  if (!places.is_cpu()) return;
  const std::int64_t* place = places.const_data_ptr<std::int64_t>() + column;
  for (std::int64_t e = 0; e < places.size(0); ++e, place += 4)
    GRANPINN_CHECK_VALUE(is_place(place, rows), "places must be within the ", rows, " ", name,
                         ", got ", place[1], " from ", place[0], " for member ", e);
}

inline AdamSettings adam_settings(Doubles values) {
  GRANPINN_CHECK_VALUE(values.size() == 4,
                       "adam must be [learning_rate, beta_1, beta_2, epsilon], got ", values.size(),
                       " values");
  const AdamSettings s{values[0], values[1], values[2], values[3]};
  GRANPINN_CHECK_VALUE(finite(s.learning_rate) && finite(s.epsilon) && s.epsilon >= 0,
                       "adam must have a finite learning_rate and epsilon >= 0, got ",
                       s.learning_rate, " and ", s.epsilon);
  GRANPINN_CHECK_VALUE(s.beta_1 >= 0 && s.beta_1 < 1 && s.beta_2 >= 0 && s.beta_2 < 1,
                       "adam must have beta_1 and beta_2 in [0, 1), got ", s.beta_1, " and ",
                       s.beta_2);
  return s;
}

// Checks the codes of `Variable` [E, N] and the bounds of q [E, N, 2] of the laws; their N. The
// values are checked on a CPU. On a GPU the check would wait for it, and a wrong code is `fixed`.
inline std::int64_t check_law_variables(const at::Tensor& variables, const at::Tensor& bounds) {
  GRANPINN_CHECK_VALUE(
      variables.dim() == 2 && variables.size(1) >= 1 && variables.size(1) <= kMaxLawParameters,
      "variables must be [E, 1 to ", kMaxLawParameters, "], got ", shape_of(variables));
  if (!variables.is_cpu() || !bounds.is_cpu() || variables.scalar_type() != at::kLong ||
      bounds.scalar_type() != at::kDouble || bounds.numel() != 2 * variables.numel())
    return variables.size(1);  // other checks refuse these
  const at::Tensor codes = variables.contiguous(), limits = bounds.contiguous();
  const auto* code = codes.const_data_ptr<std::int64_t>();
  const auto* limit = limits.const_data_ptr<double>();
  for (std::int64_t i = 0; i < codes.numel(); ++i) {
    GRANPINN_CHECK_VALUE(code[i] >= 0 && code[i] < kVariables, "variables must be in 0..",
                         kVariables - 1, ", got ", code[i]);
    GRANPINN_CHECK_VALUE(limit[2 * i] <= limit[2 * i + 1],
                         "bounds must be (low, high) with low <= high, got ", limit[2 * i], " and ",
                         limit[2 * i + 1]);
    GRANPINN_CHECK_VALUE(
        i % codes.size(1) != 0 || code[i] != static_cast<int>(Variable::logarithm_above),
        "the first parameter of a law has no parameter below it, got ", code[i]);
  }
  return codes.size(1);
}

// The matrices (begin, size) among P parameters, ascending and apart, to `region`; their number.
inline int regions_of(Ints matrices, std::int64_t P, Region (&region)[kMaxRegions]) {
  const std::size_t count = matrices.size() / 2;
  GRANPINN_CHECK_VALUE(matrices.size() % 2 == 0 && count <= kMaxRegions,
                       "matrices must be (begin, size) of at most ", kMaxRegions,
                       " hidden matrices, got ", matrices.size(), " numbers");
  std::int64_t end = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const auto [begin, size] = region[i] = {matrices[2 * i], matrices[2 * i + 1]};
    GRANPINN_CHECK_VALUE(begin >= end && size >= 0, "matrices must be ascending and apart, got ",
                         matrices);
    GRANPINN_CHECK_VALUE(within(begin, size, P), "matrices must end within ", P,
                         " parameters, got ", matrices);
    end = begin + size;
  }
  return static_cast<int>(count);
}

// [E, P] and the type of params.
inline std::pair<std::int64_t, std::int64_t> ensemble_of(const at::Tensor& params) {
  GRANPINN_CHECK_TYPE(params.scalar_type() == at::kFloat || params.scalar_type() == at::kDouble,
                      "params must be float32 or float64, got ", shape_of(params));
  GRANPINN_CHECK_VALUE(params.dim() == 2, "params must be [E, P], got ", shape_of(params));
  return {params.size(0), params.size(1)};
}

}  // namespace granpinn
