// Checks of arguments: a failed one raises Python's ValueError or TypeError.
//
// Messages are put together without streams: in some builds of torch, whose libraries bring parts
// of another C++ library along, printing a number into a stream crashes.
#pragma once

#include <ATen/core/Tensor.h>

#include <string>

namespace granpinn {

inline const std::string& text(const std::string& a) { return a; }
inline std::string text(const char* a) { return a; }
inline std::string text(c10::string_view a) { return std::string(a.data(), a.size()); }

template <class T>
  requires std::is_arithmetic_v<T>
std::string text(T a) {
  return std::to_string(a);
}

inline std::string text(at::IntArrayRef a) {
  std::string out = "[";
  for (std::size_t i = 0; i < a.size(); ++i) out += (i ? ", " : "") + std::to_string(a[i]);
  return out + "]";
}

template <class... Parts>
std::string message(const Parts&... parts) {
  std::string out;
  ((out += text(parts)), ...);
  return out;
}

}  // namespace granpinn

#define GRANPINN_CHECK_VALUE(condition, ...) \
  TORCH_CHECK_VALUE(condition, granpinn::message(__VA_ARGS__))
#define GRANPINN_CHECK_TYPE(condition, ...) \
  TORCH_CHECK_TYPE(condition, granpinn::message(__VA_ARGS__))
