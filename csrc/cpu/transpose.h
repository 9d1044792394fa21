// A 32 x 32 block, transposed in registers.
#pragma once

#include <utility>

#include "gemm.h"

namespace granpinn {
namespace GRANPINN_SIMD_NAMESPACE {

// One butterfly: rows a and b, apart by `Distance`, exchange the lanes whose index has that bit.
template <int Distance, class V, std::size_t... i>
GRANPINN_INLINE void exchange(V& a, V& b, std::index_sequence<i...>) {
  constexpr int N = sizeof...(i);
  const V low = V(__builtin_shufflevector(a.v, b.v, ((i & Distance) ? N + i - Distance : i)...));
  const V high = V(__builtin_shufflevector(a.v, b.v, ((i & Distance) ? N + i : i + Distance)...));
  a = low;
  b = high;
}

template <int Distance, class V, int N>
GRANPINN_INLINE void butterflies(V (&row)[N]) {
  if constexpr (Distance < N) {
    for (int i = 0; i < N; ++i)
      if (!(i & Distance))
        exchange<Distance>(row[i], row[i + Distance], std::make_index_sequence<N>{});
    butterflies<2 * Distance>(row);
  }
}

// out[j][i] = in[i][j], both [kTile][kTile]
template <class T>
void transpose(const T* in, T* out) {
  constexpr int N = kLanes<T>;
  using V = Vec<T>;
  for (int i = 0; i < kTile; i += N)
    for (int j = 0; j < kTile; j += N) {
      V row[N];
      for (int k = 0; k < N; ++k) row[k] = V::load(in + (i + k) * kTile + j);
      butterflies<1>(row);
      for (int k = 0; k < N; ++k) row[k].store(out + (j + k) * kTile + i);
    }
}

}  // namespace GRANPINN_SIMD_NAMESPACE
}  // namespace granpinn
