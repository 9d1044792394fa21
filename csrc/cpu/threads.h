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

// The gradients of all threads of one network.
template <class T>
class TeamGradient {
 public:
  TeamGradient(const Network<T>& net, std::int64_t team)
      : net_(net),
        team_(team),
        size_(gradient_offset(net, net.layers)),
        blocks_(at::zeros({team, size_}, at::TensorOptions().dtype(c10::CppTypeToScalarType<T>()))),
        totals_(at::zeros({team, size_}, at::kDouble)) {}

  GradientSum<T> of_thread(std::int64_t i) const {
    return {blocks_.mutable_data_ptr<T>() + i * size_,
            totals_.mutable_data_ptr<double>() + i * size_, size_};
  }

  // The sum over threads, in order, into `out` (flat layout).
  void sum(T* out) const {
    const double* totals = totals_.const_data_ptr<double>();
    for (int l = 0; l < net_.layers; ++l) {
      const std::int64_t in = net_.in(l), rows = net_.out(l), ld = padded(in);
      const double* from = totals + gradient_offset(net_, l);
      T* to = out + net_.offset(l);
      // one more row for the bias
      at::parallel_for(0, rows + 1, 64, [&](std::int64_t first, std::int64_t last) {
        for (std::int64_t row = first; row < last; ++row) {
          const std::int64_t length = row < rows ? in : rows;
          for (std::int64_t i = 0; i < length; ++i) {
            double sum = 0;
            for (std::int64_t t = 0; t < team_; ++t) sum += from[t * size_ + row * ld + i];
            to[row * in + i] = static_cast<T>(sum);
          }
        }
      });
    }
  }

 private:
  const Network<T>& net_;
  std::int64_t team_, size_;
  at::Tensor blocks_, totals_;
};

}  // namespace granpinn
