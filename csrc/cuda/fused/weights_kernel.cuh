// Gradient of the hidden weights of a layer, summed over the rows r of a chunk:
//
//   dL/dW[o][i] = sum_r G[r][o] A[r][i],   o, i < H;   r < chunk.count * panel_rows
//
// A block computes an M x 128 tile of dL/dW over one of `splits` shares of the rows. collect.cuh
// adds up the splits.
//
//   stage of the ring, shared                      tile of weights, registers
//                   G: M     A: 128                          128 weights i
//                 +--------+--------+-+                  +---------+---------+
//   stage_rows    | group 0, `steps`|p|           M      | 64 x 64 | 64 x 64 |   a warp of
//   rows r        | of step_rows    |a|           weights+---------+---------+   each group has
//                 +-----------------+d|           o      | 64 x 64 | 64 x 64 |   such a square
//                 | group 1 ...     | |                  +---------+---------+
//                 +-----------------+-+
//                 | scales (halves) |
//                 +-----------------+
//
//   name       shape                           where      layout
//   G, A       [E][L - 1][chunk rows][H]       global     scratch.adjoints, scratch.activations
//   ring       2 or 3 stages                   shared     each as above, P::stage_size elements
//   operands   2 x a step                      registers  one in use, one being loaded
//   sum        128 weights                     registers  over the rows of the thread's group
//   others     groups (groups - 1) shares      shared     in place of the ring: [adder][from][run]
//   gradients  [E][L - 1][splits][H][H]        global     one split for each blockIdx.y
//
// 256 threads form `groups` groups, which compute the same weights from different rows of a stage.
// Their sums are added in fixed order. weights_tile.cuh lists M, stage_rows and groups.
#pragma once

#include <cuda_pipeline_primitives.h>
#include "../launch_after.cuh"

#include <type_traits>

#include "weights_tile.cuh"

namespace granpinn::cuda::fused {

// Copies W neurons of the rows of a panel into the ring: a thread's share of them. A group copies
// the rows that it multiplies.
template <class P, int H, int W>
class PanelStream {
 public:
  using Element = typename P::Element;

  // from: the first row; to: its place in the first stage.
  __device__ PanelStream(const Element* from, const Element* to)
      : from_(from + row() * H + column()),
        to_(static_cast<unsigned>(__cvta_generic_to_shared(to + row() * P::ld + column()))) {}

  // Fetches the rows of the next stage, `left` of them, then zeros. stage: offset in elements.
  __device__ void fetch(int stage, int left) {
#pragma unroll
    for (int i = 0; i < rows; i += down) copy(stage, i, row() + i < left ? 16 : 0);
    from_ += P::stage_rows * H;
  }
  __device__ void fetch(int stage) {
#pragma unroll
    for (int i = 0; i < rows; i += down) copy(stage, i);
    from_ += P::stage_rows * H;
  }

 private:
  static constexpr int size = sizeof(Element), own = 16 / size;
  static constexpr int threads = P::threads / P::groups, rows = P::stage_rows / P::groups;
  static constexpr int across = W / own, down = threads / across;
  static_assert(rows % down == 0, "whole passes");

  static __device__ int row() {
    return threadIdx.x / threads * rows + threadIdx.x % threads / across;
  }
  static __device__ int column() { return threadIdx.x % across * own; }
  __device__ void copy(int stage, int i) {
    asm volatile("cp.async.cg.shared.global.L2::128B [%0], [%1], 16;" ::"r"(
                     to_ + size * (stage + i * P::ld)),
                 "l"(from_ + i * H)
                 : "memory");
  }
  __device__ void copy(int stage, int i, int bytes) {
    asm volatile("cp.async.cg.shared.global.L2::128B [%0], [%1], 16, %2;" ::"r"(
                     to_ + size * (stage + i * P::ld)),
                 "l"(from_ + i * H), "r"(bytes)
                 : "memory");
  }

  const Element* from_;
  unsigned to_;
};

// Copies the exponents of the scales into the ring, one thread for every four rows of a stage.
template <class P>
class Scales {
 public:
  __device__ Scales(const Scratch& scratch, std::int64_t at, int count, int* to)
      : g_(scratch.adjoint_scales + at), a_(scratch.activation_scales + at), count_(count) {
    to_ = to + threadIdx.x;
  }

  // Fetches those of the block's stage s. stage: offset in elements.
  __device__ void fetch(int s, int stage) {
    constexpr int fours = P::stage_rows / 4;
    const int i = s * fours + threadIdx.x;
    if (threadIdx.x >= fours || i >= count_) return;
    int* to = to_ + stage / 2;
    __pipeline_memcpy_async(to, g_ + i, 4);
    __pipeline_memcpy_async(to + fours, a_ + i, 4);
  }

  // The smallest sum of an exponent of G and one of A in the block's rows, for all threads.
  __device__ int least() {
    __shared__ int of_warps[P::threads / 32];
    int least = 2 * kNoScale;
    for (int i = threadIdx.x; i < count_; i += P::threads) least = min(least, g_[i] + a_[i]);
    least = __reduce_min_sync(~0u, least);
    if (threadIdx.x % 32 == 0) of_warps[threadIdx.x / 32] = least;
    __syncthreads();
#pragma unroll
    for (int w = 0; w < P::threads / 32; ++w) least = min(least, of_warps[w]);
    return least < kNoScale ? least : 0;  // 0 if all products are zero
  }

 private:
  const int *g_, *a_;
  int count_;
  int* to_;
};

// blockIdx = (tile of weights, split of the rows, member x layer). The ring has 2 or 3 stages.
template <class P, int H>
__global__ void __launch_bounds__(P::threads, 1)
    weights_kernel(const __grid_constant__ LaunchPlan plan, const Scratch scratch,
                   const Chunk chunk) {
  using Element = typename P::Element;
  extern __shared__ __align__(16) unsigned char memory[];
  Element* shared = reinterpret_cast<Element*>(memory);
  constexpr int steps = P::stage_rows / (P::groups * P::step_rows);
  static_assert(steps % 2 == 0, "operands of a stage's last step are in the second buffer");
  const int out0 = blockIdx.x / (H / P::N) * P::M, in0 = blockIdx.x % (H / P::N) * P::N;
  const int rows = chunk.count * plan.tile.panel_rows;
  const std::int64_t all = (rows + P::stage_rows - 1) / P::stage_rows;
  const int begin = static_cast<int>(blockIdx.y * all / plan.splits);
  const int end = static_cast<int>((blockIdx.y + 1) * all / plan.splits);
  const std::int64_t first = blockIdx.z * plan.panel() + std::int64_t(begin) * P::stage_rows * H;
  PanelStream<P, H, P::M> G(static_cast<Element*>(scratch.adjoints) + first + out0, shared);
  PanelStream<P, H, P::N> A(static_cast<Element*>(scratch.activations) + first + in0,
                            shared + P::M);
  [[maybe_unused]] Scales<P> scales(scratch,
                                    blockIdx.z * plan.scales() + begin * (P::stage_rows / 4),
                                    (min(end * P::stage_rows, rows) - begin * P::stage_rows) / 4,
                                    reinterpret_cast<int*>(shared + P::scales));

  const auto fetch = [&](int s, int stage) {
    const int left = rows - s * P::stage_rows;
    if (s < end && left >= P::stage_rows)
      G.fetch(stage), A.fetch(stage);
    else if (s < end)
      G.fetch(stage, left), A.fetch(stage, left);
    if constexpr (P::scaled) scales.fetch(s - begin, stage);
    __pipeline_commit();
  };
  constexpr int group_threads = P::threads / P::groups;
  const int group = threadIdx.x / group_threads;
  // Waits until the oldest of the stages under way is complete. Under way are all stages of the
  // ring, or (fewer = 1) one fewer. Groups wait for each other only if there are scales.
  const auto wait = [&](auto fewer) {
    if (plan.weights_stages == 2)
      __pipeline_wait_prior(1 - fewer());
    else
      __pipeline_wait_prior(2 - fewer());
    if constexpr (P::scaled || P::groups == 1)
      __syncthreads();
    else
      asm volatile("bar.sync %0, %1;" ::"r"(1 + group), "n"(group_threads) : "memory");
  };
  const auto load = [&](int stage, int step, typename P::Operands& operands) {
    P::load(shared + stage, (group * steps + step) * P::step_rows, operands);
  };

  wait_for_earlier();
  for (int i = 0; i < plan.weights_stages; ++i) fetch(begin + i, i * P::stage_size);
  int least = 0;
  if constexpr (P::scaled) least = scales.least();
  wait(std::integral_constant<int, 0>());
  typename P::Operands operands[2];
  float sum[P::values] = {};
  const int last = (plan.weights_stages - 1) * P::stage_size;
  int stage = 0;
  load(stage, 0, operands[0]);
  // small tiles have few rows: fetching the code of a long loop from L2 would take much of the time
  constexpr int unroll = P::scaled || P::groups == 1 ? steps / 2 : 1;
  for (int s = begin; s < end; ++s) {
#pragma unroll unroll
    for (int step = 0; step < steps; step += 2) {
      load(stage, step + 1, operands[1]);
      P::multiply(operands[0], least, sum);
      if (step + 2 < steps) {
        load(stage, step + 2, operands[0]);
      } else {  // the group has read this stage: the next fetch overwrites it
        wait(std::integral_constant<int, 1>());
        const int next = stage == last ? 0 : stage + P::stage_size;
        load(next, 0, operands[0]);
        fetch(s + plan.weights_stages, stage);
        stage = next;
      }
      P::multiply(operands[1], least, sum);
    }
  }
  __pipeline_wait_prior(0);

  // One thread of each group has the same weights. Each of these adds and stores its share of them.
  using Run = typename P::Run;
  constexpr int groups = P::groups;
  constexpr int share = P::values * sizeof(float) / sizeof(Run) / groups;
  Run* others = reinterpret_cast<Run*>(memory) + threadIdx.x % group_threads;
  const auto place = [&](int from, int q) {  // of run q of group `from`, for the group that adds it
    const int adder = q / share;
    return ((adder * (groups - 1) + from - (from > adder)) * share + q % share) * group_threads;
  };
  if (groups > 1) {
    __syncthreads();
#pragma unroll
    for (int q = 0; q < share * groups; ++q)
      if (q / share != group) others[place(group, q)] = P::run(sum, q);
    __syncthreads();
  }
  float* to = scratch.gradients + (std::int64_t(blockIdx.z) * plan.splits + blockIdx.y) * H * H +
              out0 * H + in0;
  // removes the scales in two steps: a single power of two may not be a normal number
  const float scale[2] = {power_of_two(-least / 2), power_of_two(-least - -least / 2)};
#pragma unroll
  for (int q = 0; q < share * groups; ++q) {
    if (q / share != group) continue;
    Run total = P::run(sum, q);
#pragma unroll
    for (int g = 1; g < groups; ++g) total = total + others[place((q / share + g) % groups, q)];
    if constexpr (P::scaled) total = total * scale[0] * scale[1];
    total = P::in_order(total);
    Run* at = reinterpret_cast<Run*>(to + P::row_of(q) * H + P::column_of(q));
    *at = chunk.begin == 0 ? total : *at + total;
  }
}

}  // namespace granpinn::cuda::fused
