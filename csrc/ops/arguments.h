// From tensors to the plain structs that kernels take, with every argument checked.
//
// Shared by all devices. The message of a check has the expected and the found value. An ensemble
// of E networks has parameters [E, P]; other tensors then have the leading E or are shared.
#pragma once

#include <ATen/ATen.h>

#include <algorithm>
#include <string>
#include <vector>

#include "checked.h"
#include "checks.h"
#include "problem.h"

namespace granpinn {

using Ints = at::IntArrayRef;
using Doubles = at::ArrayRef<double>;

inline std::string shape_of(const at::Tensor& a) {
  std::string out = "[";
  for (std::int64_t i = 0; i < a.dim(); ++i) out += (i ? ", " : "") + std::to_string(a.size(i));
  return out + "] " + c10::toString(a.scalar_type()) + " on " + a.device().str();
}

// Number of parameters of a network; checks its widths.
inline std::int64_t parameter_count(Ints widths) {
  GRANPINN_CHECK_VALUE(widths.size() >= 2 && widths[0] == 3,
                       "widths must be [3, hidden ..., outputs], got ", widths);
  GRANPINN_CHECK_VALUE(widths.size() <= kMaxLayers + 1, "a network has at most ", kMaxLayers,
                       " layers, got ", widths.size() - 1);
  for (const auto w : widths)
    GRANPINN_CHECK_VALUE(w >= 1 && w <= 65536, "widths must be in 1..65536, got ", widths);
  std::int64_t count = 0;
  for (std::size_t l = 0; l + 1 < widths.size(); ++l)
    count = checked_add(count, checked_mul(widths[l] + 1, widths[l + 1]));
  return count;
}

// Number of parameters of a network; checks its widths and its input map.
inline std::int64_t parameter_count(Ints widths, Doubles shift, Doubles scale) {
  GRANPINN_CHECK_VALUE(shift.size() == 3 && scale.size() == 3,
                       "input_shift and input_scale must have 3 values (x, y, t), got ",
                       shift.size(), " and ", scale.size());
  return parameter_count(widths);
}

// The ensemble's size: 0 where params is a single vector [P].
inline std::int64_t ensemble_size(const at::Tensor& params, std::int64_t count) {
  GRANPINN_CHECK_TYPE(params.scalar_type() == at::kFloat || params.scalar_type() == at::kDouble,
                      "params must be float32 or float64, got ", shape_of(params));
  GRANPINN_CHECK_VALUE((params.dim() == 1 || params.dim() == 2) && params.size(-1) == count,
                       "params must be [", count, "] or [E, ", count, "] for these widths, got ",
                       shape_of(params));
  GRANPINN_CHECK_VALUE(params.dim() == 1 || params.size(0) >= 1,
                       "params must be of one network or more, got ", shape_of(params));
  return params.dim() == 2 ? params.size(0) : 0;
}

// A tensor of the ensemble, contiguous, and the distance between members (0: shared).
struct Shared {
  at::Tensor data;
  std::int64_t stride;

  template <class T>
  const T* member(std::int64_t e) const {
    return data.const_data_ptr<T>() + e * stride;
  }
};

// Checks type, device and trailing shape (-1: any size) against params.
inline Shared shared(const char* name, const at::Tensor& a, const at::Tensor& params,
                     std::int64_t ensemble, std::vector<std::int64_t> shape) {
  const auto rank = static_cast<std::int64_t>(shape.size());
  GRANPINN_CHECK_TYPE(a.scalar_type() == params.scalar_type() && a.device() == params.device(),
                      name, " must have the type and device of params, ", shape_of(params),
                      ", got ", shape_of(a));
  const bool own = a.dim() == rank + 1;
  bool fits = a.dim() == rank || (own && ensemble > 0 && a.size(0) == ensemble);
  for (std::int64_t i = 0; fits && i < rank; ++i)
    fits = shape[i] < 0 || a.size(a.dim() - rank + i) == shape[i];
  std::string expected;
  for (const auto s : shape)
    expected += (expected.empty() ? "" : ", ") + (s < 0 ? std::string("N") : std::to_string(s));
  GRANPINN_CHECK_VALUE(
      fits, name, " must be [", expected, "]",
      ensemble > 0 ? " with or without a leading E = " + std::to_string(ensemble) : std::string(),
      ", got ", shape_of(a));
  return {a.contiguous(), own ? a.numel() / ensemble : 0};
}

// The input map (x - shift) scale may come as host lists or from a tensor: `Values` is either.
template <class T, class Values>
Network<T> network(const T* params, Ints widths, const Values& shift, const Values& scale) {
  Network<T> net{};
  net.widths = widths.data();
  net.layers = static_cast<int>(widths.size()) - 1;
  net.params = params;
  for (int i = 0; i < 3; ++i) {
    net.shift[i] = static_cast<T>(shift[i]);
    net.scale[i] = static_cast<T>(scale[i]);
  }
  return net;
}

inline void check_physics(std::int64_t count) {
  std::string names;
  for (const char* name : kPhysicsFields) names += (names.empty() ? "" : ", ") + std::string(name);
  GRANPINN_CHECK_VALUE(count == kPhysics, "physics must be [", names, "], got ", count, " values");
}

// Refuses constants with which a clamp or the root of I would hide a NaN. Returns them.
template <class T>
const Physics<T>& sound(const Physics<T>& c) {
  GRANPINN_CHECK_VALUE(c.eta_min <= c.eta_max, "eta_min must be at most eta_max, got ", c.eta_min,
                       " and ", c.eta_max);
  GRANPINN_CHECK_VALUE(c.pressure_floor >= 0,
                       "the floor of the pressure must not be negative, got ", c.pressure_floor);
  GRANPINN_CHECK_VALUE(c.law_rate > 0, "law_rate must be positive, got ", c.law_rate);
  GRANPINN_CHECK_VALUE(c.side_wall >= 0 && c.side_wall_speed > 0,
                       "side_wall must not be negative and side_wall_speed must be positive, got ",
                       c.side_wall, " and ", c.side_wall_speed);
  return c;
}

template <class T>
Physics<T> physics_of(Doubles values) {
  check_physics(static_cast<std::int64_t>(values.size()));
  return sound(physics_from<T>(values.data()));
}

inline LawName law_of(c10::string_view name) {
  std::string known;
#define GRANPINN_ROW(row, Law) \
  known += (known.empty() ? "'" : ", '") + std::string(Law::name) + "'";
  GRANPINN_LAWS(GRANPINN_ROW)
#undef GRANPINN_ROW
  LawName found{};
  GRANPINN_CHECK_VALUE(law_named(std::string_view(name.data(), name.size()), &found),
                       "law must be one of ", known, ", got '", name, "'");
  return found;
}

// The laws of a list of names with commas between them.
inline std::vector<LawName> laws_of(c10::string_view names) {
  std::vector<LawName> found;
  for (std::size_t at = 0; at <= names.size();) {
    const std::size_t end = std::min(names.find(',', at), names.size());
    found.push_back(law_of(names.substr(at, end - at)));
    at = end + 1;
  }
  return found;
}

inline Form form_of(c10::string_view name) {
  if (name == "mixed") return Form::mixed;
  if (name == "strong") return Form::strong;
  GRANPINN_CHECK_VALUE(name == "data", "form must be 'mixed', 'strong' or 'data', got '", name,
                       "'");
  return Form::data;
}

// Whether the products may run on tensor cores, compensated; a CPU has one precision only.
inline bool fast_precision(c10::string_view name) {
  GRANPINN_CHECK_VALUE(name == "fp32" || name == "fast",
                       "precision must be 'fp32' or 'fast', got '", name, "'");
  return name == "fast";
}

// A stack of matrices, [..., m, n].
inline void check_matrices(const at::Tensor& G) {
  GRANPINN_CHECK_TYPE(G.scalar_type() == at::kFloat || G.scalar_type() == at::kDouble,
                      "G must be float32 or float64, got ", shape_of(G));
  GRANPINN_CHECK_VALUE(G.dim() >= 2, "G must be [..., m, n], got ", shape_of(G));
}

inline int channels_of_order(std::int64_t order) {
  GRANPINN_CHECK_VALUE(order >= 0 && order <= 2, "order must be 0, 1 or 2, got ", order);
  return order == 0 ? 1 : order == 1 ? 4 : 7;
}

}  // namespace granpinn
