// The part of the launch plan for the weights kernel: size of its tile, stages, splits of the rows.
//
//   time = rounds (rows of a split * row + block) + 4 bytes * weights of all splits * kAddTime
#pragma once

#include <algorithm>

#include "fused_loss.h"
#include "weights_kernel.cuh"

namespace granpinn::cuda::fused {

constexpr std::int64_t ceil_div(std::int64_t a, std::int64_t b) { return (a + b - 1) / b; }

// Time of a block in nanoseconds, measured on an H200: for each row, and for its start and end. The
// plan depends on the ratios alone.
struct WeightsTime {
  double row, block;
};
constexpr WeightsTime weights_time(bool tensor_cores, int tile_rows) {
  if (tensor_cores)
    return tile_rows == 256   ? WeightsTime{34, 13000}
           : tile_rows == 128 ? WeightsTime{17.5, 10200}
                              : WeightsTime{10.2, 5900};
  return tile_rows == 256   ? WeightsTime{164, 13000}
         : tile_rows == 128 ? WeightsTime{83, 5500}
                            : WeightsTime{44.5, 3700};
}
// Nanoseconds to add up a byte of a split: between the time for few rows and that for so many rows
// that the panels fill the cache.
constexpr double kAddTime = 3e-4;

// Calls visit(P) with the policy P of the weights kernel that the plan selects.
template <int H, class Visit>
auto visit_weights(const LaunchPlan& plan, Visit visit) {
  if constexpr (H == 256)
    if (plan.weights_rows == 256)
      return plan.tensor_cores ? visit(MmaWeights<256, 64>{}) : visit(SimtWeights<256, 16>{});
  if (plan.weights_rows == 128)
    return plan.tensor_cores ? visit(MmaWeights<128, 64>{}) : visit(SimtWeights<128, 32>{});
  return plan.tensor_cores ? visit(MmaWeights<64, 128>{}) : visit(SimtWeights<64, 32>{});
}

// Stages that a block reads if the rows of a chunk are cut into `splits`.
template <class P>
std::int64_t split_stages(const LaunchPlan& plan, std::int64_t splits) {
  const std::int64_t rows = std::int64_t(plan.chunk) * plan.tile.panel_rows;
  return ceil_div(ceil_div(rows, P::stage_rows), splits);
}

// Nanoseconds of the weights kernel, and of adding up the splits.
template <class P>
double weights_time(const LaunchPlan& plan, std::int64_t panels, int multiprocessors) {
  const WeightsTime time = weights_time(plan.tensor_cores, plan.weights_rows);
  const std::int64_t weights = panels * plan.H * plan.H * plan.splits;
  const auto rows = static_cast<double>(split_stages<P>(plan, plan.splits) * P::stage_rows);
  const auto rounds = static_cast<double>(ceil_div(weights / (P::M * P::N), multiprocessors));
  return rounds * (rows * time.row + time.block) + 4 * kAddTime * static_cast<double>(weights);
}

// Chooses tile, stages and splits for `panels` pairs of panels (members x hidden layers). Returns
// false if no tile fits into shared memory.
inline bool plan_weights(LaunchPlan& plan, std::int64_t panels, const DeviceLimits& device) {
  double best = 0;
  for (const int tile_rows : {64, 128, 256}) {
    if (tile_rows > plan.H) continue;
    LaunchPlan p = plan;
    p.weights_rows = tile_rows;
    const auto consider = [&](auto policy) {
      using P = decltype(policy);
      p.weights_stages = P::memory(3) <= device.shared_per_block ? 3 : 2;
      if (P::memory(p.weights_stages) > device.shared_per_block) return;
      // splits that fill the GPU once, twice, ...; of those with equal stages, the fewest
      const std::int64_t blocks = panels * (p.H / P::M) * (p.H / P::N);
      const std::int64_t fewest = ceil_div(blocks, device.multiprocessors);
      for (std::int64_t rounds = fewest; rounds < fewest + 8; ++rounds) {
        const std::int64_t most = rounds * device.multiprocessors / blocks;
        p.splits = static_cast<int>(split_stages<P>(p, split_stages<P>(p, most)));
        const double time = weights_time<P>(p, panels, device.multiprocessors);
        if (best > 0 && time >= best) continue;
        best = time;
        plan = p;
      }
    };
    p.H == 128 ? visit_weights<128>(p, consider) : visit_weights<256>(p, consider);
  }
  return best > 0;
}

}  // namespace granpinn::cuda::fused
