// The multiply-add peak of a core: the yardstick of the benchmarks.
#pragma once

#include "simd.h"

namespace granpinn {
namespace GRANPINN_SIMD_NAMESPACE {

// `rounds` multiply-adds on each of 24 registers that do not wait for one another; returns the
// floating-point operations done. `sink` keeps the compiler from dropping the work.
template <class T>
double multiply_add(std::int64_t rounds, T* sink) {
  using V = Vec<T>;
  constexpr int kChains = kVectorBytes == 64 ? 24 : 12;  // of 32 or 16 registers
  V a[kChains];
  for (int i = 0; i < kChains; ++i) a[i] = V(T(i));
  const V b(sink[0]), c(sink[1]);
  for (std::int64_t k = 0; k < rounds; ++k) {
#pragma GCC unroll 24
    for (int i = 0; i < kChains; ++i) a[i].v = a[i].v * b.v + c.v;
  }
  V sum(T(0));
  for (int i = 0; i < kChains; ++i) sum += a[i];
  sink[0] = sum.sum();
  return 2.0 * kChains * kLanes<T> * static_cast<double>(rounds);
}

}  // namespace GRANPINN_SIMD_NAMESPACE
}  // namespace granpinn
