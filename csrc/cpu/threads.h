// Work in fixed, contiguous ranges, one for each thread. So sums are the same in every run with the
// same number of threads.
//
//   memory of a thread   | workspace: T | block: T [gradient] | total: double [gradient] |
#pragma once

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include "checked.h"
#include "kernel_table.h"

namespace granpinn {

inline std::int64_t tiles_of(std::int64_t points) {
  return (points + kTilePoints - 1) / kTilePoints;
}

// Number of threads for `tiles` tiles: at most one for each.
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

// The threads that work on one network, with scratch memory and gradient of each.
//
// The memory belongs to the calling thread, which keeps it for its next call. New pages of a few
// megabytes in every step would cost as much as the arithmetic of a small batch.
template <class T>
class Team {
 public:
  Team(const Network<T>& net, int channels, std::int64_t tiles)
      : net_(net),
        size_(team_size(tiles)),
        workspace_bytes_(padded(workspace_size(net, channels)) * sizeof(T)),
        gradient_(padded(gradient_offset(net, net.layers))),
        share_(workspace_bytes_ + gradient_ * (sizeof(T) + sizeof(double))) {
    thread_local at::Tensor kept;
    const std::int64_t bytes = checked_mul(size_, share_);
    if (!kept.defined() || kept.numel() < bytes) kept = at::empty({bytes}, at::kByte);
    memory_ = kept.mutable_data_ptr<std::uint8_t>();
  }

  std::int64_t size() const { return size_; }

  T* workspace(std::int64_t thread) const {
    return reinterpret_cast<T*>(memory_ + thread * share_);
  }

  // An empty sum. Call it in thread `thread`, so that the pages are near its core.
  GradientSum<T> gradient(std::int64_t thread) const {
    T* block = reinterpret_cast<T*>(memory_ + thread * share_ + workspace_bytes_);
    for (std::int64_t i = 0; i < gradient_; ++i) block[i] = T(0);
    return {block, total(thread), gradient_};
  }

  // The flushed gradients, summed over the threads in order, into `out` (flat layout).
  void sum(T* out) const {
    at::parallel_for(0, net_.layers, 1, [&](std::int64_t first, std::int64_t last) {
      for (std::int64_t l = first; l < last; ++l) sum_layer(static_cast<int>(l), out);
    });
  }

 private:
  double* total(std::int64_t thread) const {
    return reinterpret_cast<double*>(memory_ + thread * share_ + workspace_bytes_ +
                                     gradient_ * sizeof(T));
  }

  void sum_layer(int l, T* out) const {
    const std::int64_t in = net_.in(l), rows = net_.out(l), ld = padded(in);
    const std::int64_t from = gradient_offset(net_, l);
    T* to = out + net_.offset(l);
    for (std::int64_t row = 0; row <= rows; ++row) {  // the last row: the bias
      const std::int64_t length = row < rows ? in : rows;
      for (std::int64_t i = 0; i < length; ++i) {
        double sum = 0;
        for (std::int64_t t = 0; t < size_; ++t) sum += total(t)[from + row * ld + i];
        to[row * in + i] = static_cast<T>(sum);
      }
    }
  }

  const Network<T>& net_;
  std::int64_t size_, workspace_bytes_, gradient_, share_;
  std::uint8_t* memory_;
};

}  // namespace granpinn
