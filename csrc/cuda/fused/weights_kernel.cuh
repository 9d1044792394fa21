// Gradient of the hidden weights: G^T A, summed over the rows of a chunk.
//
// A block computes M x 128 weights over a share of the rows, which a ring of stages in shared
// memory takes from the panels. Its threads form groups that take turns at the rows of a stage and
// are added up in fixed order. A thread reads its operands in runs of neurons, a step ahead.
#pragma once

#include <cuda_pipeline_primitives.h>
#include "../launch_after.cuh"

#include <type_traits>

#include "layout.h"

namespace granpinn::cuda::fused {

// A block computes M x N weights; a stage of its ring has StageRows rows, of G and of A side by
// side. Of every four rows, each starts Padding floats later than without: in other banks.
template <int Rows, int StageRows, int Padding>
struct WeightsTile {
  static constexpr int threads = 256, M = Rows, N = 128;
  static constexpr int values = 128;  // weights of a thread
  static constexpr int groups = threads * values / (M * N);
  static constexpr int stage_rows = StageRows;
  static constexpr int ld = M + N + Padding;

  // Where a row of a stage starts, in floats.
  static constexpr GRANPINN_HD int row_offset(int row) { return row * ld - row / 4 * Padding; }
  static constexpr int stage_size = StageRows * ld - StageRows / 4 * Padding;
  static constexpr int memory(int stages) {  // bytes: the ring, then the sums of all groups but one
    const int ring = stages * stage_size, sums = (groups - 1) * M * N;
    return 4 * (ring > sums ? ring : sums);
  }

  // A warp computes 64 x 64 weights, or a share of the rows of so many.
  static __device__ int warp() { return threadIdx.x % (threads / groups) / 32; }
  static __device__ int warp_row() { return warp() / (N / 64) * 64; }
  static __device__ int warp_column() { return warp() % (N / 64) * 64; }
};

__device__ inline float element(const float4& v, int i) {
  return i == 0 ? v.x : i == 1 ? v.y : i == 2 ? v.z : v.w;
}
__device__ inline float2 operator+(const float2& a, const float2& b) {
  return {a.x + b.x, a.y + b.y};
}
__device__ inline float4 operator+(const float4& a, const float4& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w};
}

// Plain float32: 8 x 16 weights per thread, a row per step.
template <int Rows, int StageRows>
struct SimtWeights : WeightsTile<Rows, StageRows, 0> {
  using Tile = WeightsTile<Rows, StageRows, 0>;
  using Tile::values, Tile::M;
  static constexpr int step_rows = 1;
  using Run = float4;  // weights of a thread, side by side

  // A warp is 8 x 4 threads, its lanes numbered so that i and i ^ 1 read the same row, i and i ^ 2
  // the same column: the hardware then merges 16-byte loads in pairs.
  static __device__ int row0() {
    const int lane = threadIdx.x % 32;
    return Tile::warp_row() + (lane / 2 % 2 + lane / 8 * 2) * 4;
  }
  static __device__ int column0() {
    const int lane = threadIdx.x % 32;
    return Tile::warp_column() + (lane % 2 + lane / 4 % 2 * 2) * 4;
  }

  struct Operands {
    float4 g[2], a[4];
  };
  static __device__ void load(const float* row, Operands& o) {
#pragma unroll
    for (int i = 0; i < 2; ++i) o.g[i] = *reinterpret_cast<const float4*>(row + row0() + i * 32);
#pragma unroll
    for (int j = 0; j < 4; ++j)
      o.a[j] = *reinterpret_cast<const float4*>(row + M + column0() + j * 16);
  }
  static __device__ void multiply(const Operands& o, float (&sum)[values]) {
#pragma unroll
    for (int v = 0; v < values; ++v)
      sum[v] = fmaf(element(o.g[v / 64], v / 16 % 4), element(o.a[v % 16 / 4], v % 4), sum[v]);
  }

  static __device__ Run run(const float (&sum)[values], int q) {
    return {sum[4 * q], sum[4 * q + 1], sum[4 * q + 2], sum[4 * q + 3]};
  }
  static __device__ int row_of(int q) { return row0() + q / 16 * 32 + q / 4 % 4; }
  static __device__ int column_of(int q) { return column0() + q % 4 * 16; }
};

__device__ inline void mma_tf32(float* d, const float (&a)[4], const float (&b)[2]) {
  asm("mma.sync.aligned.m16n8k8.row.col.f32.tf32.tf32.f32 {%0,%1,%2,%3}, {%4,%5,%6,%7}, {%8,%9}, "
      "{%0,%1,%2,%3};"
      : "+f"(d[0]), "+f"(d[1]), "+f"(d[2]), "+f"(d[3])
      : "r"(__float_as_uint(a[0])), "r"(__float_as_uint(a[1])), "r"(__float_as_uint(a[2])),
        "r"(__float_as_uint(a[3])), "r"(__float_as_uint(b[0])), "r"(__float_as_uint(b[1])));
}

// Tensor cores, TF32 (the operands are rounded already): 64 x 64 weights per warp, 8 rows a step.
// Neurons 2 g and 2 g + 1 are rows g and g + 8 of a tensor cores' tile: a thread reads both at
// once, into the registers that take them.
template <int Rows, int StageRows>
struct MmaWeights : WeightsTile<Rows, StageRows, 8> {
  using Tile = WeightsTile<Rows, StageRows, 8>;
  using Tile::values, Tile::M, Tile::ld;
  static constexpr int step_rows = 8;
  using Run = float2;

  static __device__ int lane_g() { return threadIdx.x % 32 / 4; }
  static __device__ int lane_t() { return threadIdx.x % 4; }

  struct Operands {
    float g[4][4], a[8][2];
  };
  static __device__ void load(const float* row, Operands& o) {
#pragma unroll
    for (int half = 0; half < 2; ++half) {
      const float* at = row + lane_t() * ld + Tile::row_offset(4 * half);
#pragma unroll
      for (int m = 0; m < 4; ++m) {
        const float2 v =
            *reinterpret_cast<const float2*>(at + Tile::warp_row() + lane_g() * 2 + m * 16);
        o.g[m][2 * half] = v.x, o.g[m][2 * half + 1] = v.y;
      }
#pragma unroll
      for (int n = 0; n < 8; ++n) o.a[n][half] = at[M + Tile::warp_column() + lane_g() + n * 8];
    }
  }
  static __device__ void multiply(const Operands& o, float (&sum)[values]) {
#pragma unroll
    for (int m = 0; m < 4; ++m)
#pragma unroll
      for (int n = 0; n < 8; ++n) mma_tf32(sum + (m * 8 + n) * 4, o.g[m], o.a[n]);
  }

  static __device__ Run run(const float (&sum)[values], int q) {
    return {sum[2 * q], sum[2 * q + 1]};
  }
  static __device__ int row_of(int q) {
    return Tile::warp_row() + lane_g() * 2 + q / 16 * 16 + q % 2;
  }
  static __device__ int column_of(int q) {
    return Tile::warp_column() + q / 2 % 8 * 8 + lane_t() * 2;
  }
};

// A thread's share of the rows of a panel, W neurons of each, on their way into the ring.
template <class P, int H, int W>
class PanelStream {
 public:
  // `from` is the first row, `to` its place in the first stage.
  __device__ PanelStream(const float* from, const float* to)
      : from_(from + row() * H + column()),
        to_(static_cast<unsigned>(__cvta_generic_to_shared(to + P::row_offset(row()) + column()))) {
  }

  // The next rows, `left` of them, then zeros; `stage` is an offset in floats.
  __device__ void fetch(int stage, int left) {
#pragma unroll
    for (int i = 0; i < P::stage_rows; i += down) copy(stage, i, row() + i < left ? 16 : 0);
    from_ += P::stage_rows * H;
  }
  __device__ void fetch(int stage) {
#pragma unroll
    for (int i = 0; i < P::stage_rows; i += down) copy(stage, i);
    from_ += P::stage_rows * H;
  }

 private:
  static constexpr int across = W / 4, down = P::threads / across;
  static_assert(P::stage_rows % down == 0 && down % 4 == 0, "whole passes, by four rows");

  static __device__ int row() { return threadIdx.x / across; }
  static __device__ int column() { return threadIdx.x % across * 4; }
  __device__ void copy(int stage, int i) {
    asm volatile("cp.async.cg.shared.global.L2::128B [%0], [%1], 16;" ::"r"(
                     to_ + 4 * (stage + P::row_offset(i))),
                 "l"(from_ + i * H)
                 : "memory");
  }
  __device__ void copy(int stage, int i, int bytes) {
    asm volatile("cp.async.cg.shared.global.L2::128B [%0], [%1], 16, %2;" ::"r"(
                     to_ + 4 * (stage + P::row_offset(i))),
                 "l"(from_ + i * H), "r"(bytes)
                 : "memory");
  }

  const float* from_;
  unsigned to_;
};

// blockIdx = (tile of weights, split of the rows, member x layer). The ring has 2 or 3 stages.
template <class P, int H>
__global__ void __launch_bounds__(P::threads, 1)
    weights_kernel(const __grid_constant__ Plan plan, const Scratch scratch, const Chunk chunk) {
  extern __shared__ __align__(16) float shared[];
  wait_for_earlier();
  constexpr int steps = P::stage_rows / (P::groups * P::step_rows);
  static_assert(steps % 2 == 0, "operands of a stage's last step are in the second buffer");
  const int out0 = blockIdx.x / (H / P::N) * P::M, in0 = blockIdx.x % (H / P::N) * P::N;
  const int rows = chunk.count * plan.tile.panel_rows;
  const std::int64_t all = (rows + P::stage_rows - 1) / P::stage_rows;
  const int begin = static_cast<int>(blockIdx.y * all / plan.splits);
  const int end = static_cast<int>((blockIdx.y + 1) * all / plan.splits);
  const std::int64_t first = blockIdx.z * plan.panel() + std::int64_t(begin) * P::stage_rows * H;
  PanelStream<P, H, P::M> G(scratch.adjoints + first + out0, shared);
  PanelStream<P, H, P::N> A(scratch.activations + first + in0, shared + P::M);

  const auto fetch = [&](int s, int stage) {
    const int left = rows - s * P::stage_rows;
    if (s < end && left >= P::stage_rows)
      G.fetch(stage), A.fetch(stage);
    else if (s < end)
      G.fetch(stage, left), A.fetch(stage, left);
    __pipeline_commit();
  };
  // until the oldest stage is complete, of as many as the ring has, or of one fewer
  const auto wait = [&](auto fewer) {
    if (plan.weights_stages == 2)
      __pipeline_wait_prior(1 - fewer());
    else
      __pipeline_wait_prior(2 - fewer());
    __syncthreads();
  };
  const int group = threadIdx.x / (P::threads / P::groups);
  const float* rows_of_group = shared + P::row_offset(group * steps * P::step_rows);
  const auto load = [&](int stage, int step, typename P::Operands& operands) {
    P::load(rows_of_group + stage + P::row_offset(step * P::step_rows), operands);
  };

  for (int i = 0; i < plan.weights_stages; ++i) fetch(begin + i, i * P::stage_size);
  wait(std::integral_constant<int, 0>());
  typename P::Operands operands[2];
  float sum[P::values] = {};
  const int last = (plan.weights_stages - 1) * P::stage_size;
  int stage = 0;
  load(stage, 0, operands[0]);
  for (int s = begin; s < end; ++s) {
#pragma unroll
    for (int step = 0; step < steps; ++step) {
      if (step + 1 < steps) {
        load(stage, step + 1, operands[(step + 1) % 2]);
      } else {  // all have read this stage: another takes its place
        wait(std::integral_constant<int, 1>());
        const int next = stage == last ? 0 : stage + P::stage_size;
        load(next, 0, operands[0]);
        fetch(s + plan.weights_stages, stage);
        stage = next;
      }
      P::multiply(operands[step % 2], sum);
    }
  }
  __pipeline_wait_prior(0);

  // the groups, one after another: a thread of each has the same weights
  using Run = typename P::Run;
  constexpr int runs = P::values * sizeof(float) / sizeof(Run);
  constexpr int group_threads = P::threads / P::groups;
  Run* others = reinterpret_cast<Run*>(shared) + threadIdx.x % group_threads;
  if (P::groups > 1) {
    __syncthreads();
    if (group > 0)
#pragma unroll
      for (int q = 0; q < runs; ++q)
        others[((group - 1) * runs + q) * group_threads] = P::run(sum, q);
    __syncthreads();
    if (group > 0) return;
  }
  float* to = scratch.gradients + (std::int64_t(blockIdx.z) * plan.splits + blockIdx.y) * H * H +
              out0 * H + in0;
#pragma unroll
  for (int q = 0; q < runs; ++q) {
    Run total = P::run(sum, q);
#pragma unroll
    for (int g = 1; g < P::groups; ++g)
      total = total + others[((g - 1) * runs + q) * group_threads];
    Run* at = reinterpret_cast<Run*>(to + P::row_of(q) * H + P::column_of(q));
    *at = chunk.begin == 0 ? total : *at + total;
  }
}

}  // namespace granpinn::cuda::fused
