// Transposes a 32 x 32 block in registers: squares of N x N values, N = kLanes, one after another.
//
//   N = 4, Distance 1         Distance 2
//   a0 a1 a2 a3               a0 b0 a2 b2               a0 b0 c0 d0
//   b0 b1 b2 b3   rows 0, 1   a1 b1 a3 b3   rows 0, 2   a1 b1 c1 d1
//   c0 c1 c2 c3   rows 2, 3   c0 d0 c2 d2   rows 1, 3   a2 b2 c2 d2
//   d0 d1 d2 d3               c1 d1 c3 d3               a3 b3 c3 d3
#pragma once

#include <utility>

#include "gemm.h"

namespace granpinn {
namespace GRANPINN_SIMD_NAMESPACE {

// A butterfly of rows a and b, which are `Distance` apart. Row a gives its lanes whose index has
// that bit, row b gives the others.
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
