// Arithmetic on sizes, offsets and counts that a caller chose: it never overflows.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

#include "math/scalar.h"

namespace granpinn {

// a + b; Python's ValueError if the sum does not fit into 64 bits.
inline std::int64_t checked_add(std::int64_t a, std::int64_t b) {
  std::int64_t sum = 0;
  if (__builtin_add_overflow(a, b, &sum))
    throw std::invalid_argument("sizes must have a sum below 2^63, got " + std::to_string(a) +
                                " + " + std::to_string(b));
  return sum;
}

// a * b; Python's ValueError if the product does not fit into 64 bits.
inline std::int64_t checked_mul(std::int64_t a, std::int64_t b) {
  std::int64_t product = 0;
  if (__builtin_mul_overflow(a, b, &product))
    throw std::invalid_argument("sizes must have a product below 2^63, got " + std::to_string(a) +
                                " * " + std::to_string(b));
  return product;
}

// Whether [begin, begin + count) lies within [0, size), for any numbers.
GRANPINN_HD bool within(std::int64_t begin, std::int64_t count, std::int64_t size) {
  return begin >= 0 && count >= 0 && begin <= size && count <= size - begin;
}

}  // namespace granpinn
