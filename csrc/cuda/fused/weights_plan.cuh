// Which tile the weights kernel takes, and into how many splits it cuts the rows of a chunk.
#pragma once

#include <algorithm>

#include "fused_loss.h"
#include "weights_kernel.cuh"

namespace granpinn::cuda::fused {

constexpr std::int64_t ceil_div(std::int64_t a, std::int64_t b) { return (a + b - 1) / b; }

// Nanoseconds on an H200, of which a plan depends on the ratios alone: of a block for a row, and
// for its start and end.
struct WeightsTime {
  double row, block;
};
constexpr WeightsTime weights_time(bool tensor_cores, bool large) {
  if (tensor_cores) return large ? WeightsTime{36, 11000} : WeightsTime{13.5, 4500};
  return large ? WeightsTime{164, 13000} : WeightsTime{44.5, 3700};
}
constexpr double kAddTime = 1.5e-4;  // for a byte of a split, when these are added up

// Calls `visit` with the policy of the weights kernel.
template <int H, class Visit>
auto visit_weights(const Plan& plan, Visit visit) {
  if constexpr (H == 256)
    if (plan.large_weights)
      return plan.tensor_cores ? visit(MmaWeights<256, 32>{}) : visit(SimtWeights<256, 16>{});
  return plan.tensor_cores ? visit(MmaWeights<64, 64>{}) : visit(SimtWeights<64, 32>{});
}

// Time of the weights kernel with so many splits and of adding these up.
template <class P>
double weights_time(const Plan& plan, std::int64_t panels, int multiprocessors, int splits) {
  const WeightsTime time = weights_time(plan.tensor_cores, plan.large_weights);
  const std::int64_t weights = panels * plan.H * plan.H, blocks = weights / (P::M * P::N) * splits;
  const std::int64_t stages = ceil_div(std::int64_t(plan.chunk) * plan.tile.rows, P::stage_rows);
  const double rows = static_cast<double>(ceil_div(stages, splits) * P::stage_rows);
  return static_cast<double>(ceil_div(blocks, multiprocessors)) * (rows * time.row + time.block) +
         static_cast<double>(4 * weights * splits) * kAddTime;
}

// Chooses tile, stages and splits for `panels` pairs of panels (members x hidden layers); false
// where no tile fits.
inline bool plan_weights(Plan& plan, std::int64_t panels, const DeviceLimits& device) {
  double best = 0;
  for (const bool large : {false, true}) {
    if (large && plan.H == 128) continue;
    Plan p = plan;
    p.large_weights = large;
    const auto consider = [&](auto policy) {
      using P = decltype(policy);
      p.weights_stages = P::memory(3) <= device.shared_per_block ? 3 : 2;
      if (P::memory(p.weights_stages) > device.shared_per_block) return;
      const std::int64_t rows = std::int64_t(p.chunk) * p.tile.rows;
      const std::int64_t most =
          std::min<std::int64_t>(ceil_div(rows, P::stage_rows), device.multiprocessors);
      for (p.splits = 1; p.splits <= most; ++p.splits) {
        const double time = weights_time<P>(p, panels, device.multiprocessors, p.splits);
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
