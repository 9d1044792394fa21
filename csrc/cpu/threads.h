// Work split over threads in fixed, contiguous ranges, so that sums are the same in every run with
// the same number of threads.
#pragma once

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include "kernel_table.h"

namespace granpinn {

inline std::int64_t tiles_of(std::int64_t points) {
  return (points + kTilePoints - 1) / kTilePoints;
}

// Threads worth starting for so many tiles.
inline std::int64_t team_size(std::int64_t tiles) {
  return std::max<std::int64_t>(1, std::min<std::int64_t>(at::get_num_threads(), tiles));
}

// Calls work(thread, begin, end) for each of `team` equal ranges of [0, count).
template <class Work>
void split(std::int64_t team, std::int64_t count, const Work& work) {
  at::parallel_for(0, team, 1, [&](std::int64_t first, std::int64_t last) {
    for (std::int64_t i = first; i < last; ++i) work(i, i * count / team, (i + 1) * count / team);
  });
}

// Sums the threads' gradients (padded layout, [team, size]) in order into `out` (flat layout).
template <class T>
void sum_gradients(const Network<T>& net, const T* partial, std::int64_t team, std::int64_t size,
                   T* out) {
  for (int l = 0; l < net.layers; ++l) {
    const std::int64_t in = net.in(l), rows = net.out(l), ld = padded(in);
    const T* from = partial + gradient_offset(net, l);
    T* to = out + net.offset(l);
    // one more row for the bias
    at::parallel_for(0, rows + 1, 64, [&](std::int64_t first, std::int64_t last) {
      for (std::int64_t row = first; row < last; ++row) {
        const std::int64_t length = row < rows ? in : rows;
        for (std::int64_t i = 0; i < length; ++i) {
          T sum = from[row * ld + i];
          for (std::int64_t t = 1; t < team; ++t) sum += from[t * size + row * ld + i];
          to[row * in + i] = sum;
        }
      }
    });
  }
}

}  // namespace granpinn
