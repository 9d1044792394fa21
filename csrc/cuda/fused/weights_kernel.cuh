// Gradient of the hidden weights: G^T A, summed over the rows of a chunk.
//
// A block computes M x N weights over a share of the rows, which a ring of stages in shared memory
// takes from the panels. Its threads form groups that take turns at the rows of a stage and are
// added up in fixed order. A thread reads its operands in runs of four neurons, a step ahead.
#pragma once

#include "mma_engine.cuh"

namespace granpinn::cuda::fused {

__device__ inline float element(const float4& v, int i) {
  return i == 0 ? v.x : i == 1 ? v.y : i == 2 ? v.z : v.w;
}
__device__ inline float2 operator+(const float2& a, const float2& b) {
  return {a.x + b.x, a.y + b.y};
}
__device__ inline float4 operator+(const float4& a, const float4& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w};
}

// Plain float32: 8 x Wide weights per thread, a row per step.
template <int Threads, int Rows, int Columns, int Wide, int StageRows, int Stages>
struct SimtWeights {
  static constexpr int threads = Threads, M = Rows, N = Columns;
  static constexpr int stage_rows = StageRows, stages = Stages;
  static constexpr int groups = Threads * 8 * Wide / (M * N);
  static constexpr int padding = 0;
  static constexpr int step_rows = 1;
  static constexpr int values = 8 * Wide;
  static constexpr int blocks = 512 * 8 / (Threads * Wide);  // of a multiprocessor
  using Run = float4;  // weights of a thread, side by side

  // A warp is 4 x 8 threads (8 x 4 if Wide = 16), its lanes numbered so that i and i ^ 1 read the
  // same row, i and i ^ 2 the same column: the hardware then merges 16-byte loads in pairs.
  static constexpr int lanes_n = 64 / Wide, lanes_m = 32 / lanes_n;
  static constexpr int warps_n = N / 64;

  static __device__ int warp() { return threadIdx.x % (threads / groups) / 32; }
  static __device__ int row0() {
    const int lane = threadIdx.x % 32;
    const int at = Wide == 8 ? lane / 2 % 2 + lane / 16 * 2 : lane / 2 % 2 + lane / 8 * 2;
    return (warp() / warps_n * lanes_m * 2 + at) * 4;
  }
  static __device__ int column0() {
    const int lane = threadIdx.x % 32;
    const int at = Wide == 8 ? lane % 2 + lane / 4 % 4 * 2 : lane % 2 + lane / 4 % 2 * 2;
    return warp() % warps_n * 64 + at * 4;
  }

  struct Operands {
    float4 g[2], a[Wide / 4];
  };
  static __device__ void load(const float* G, const float* A, Operands& o) {
#pragma unroll
    for (int i = 0; i < 2; ++i)
      o.g[i] = *reinterpret_cast<const float4*>(G + row0() + i * lanes_m * 4);
#pragma unroll
    for (int j = 0; j < Wide / 4; ++j)
      o.a[j] = *reinterpret_cast<const float4*>(A + column0() + j * lanes_n * 4);
  }
  static __device__ void multiply(const Operands& o, float (&sum)[values]) {
#pragma unroll
    for (int v = 0; v < values; ++v)
      sum[v] = fmaf(element(o.g[v / Wide / 4], v / Wide % 4),
                    element(o.a[v % Wide / 4], v % 4), sum[v]);
  }

  static __device__ Run run(const float (&sum)[values], int q) {
    return {sum[4 * q], sum[4 * q + 1], sum[4 * q + 2], sum[4 * q + 3]};
  }
  static __device__ int row_of(int q) {
    const int i = q / (Wide / 4);
    return row0() + i / 4 * lanes_m * 4 + i % 4;
  }
  static __device__ int column_of(int q) { return column0() + q % (Wide / 4) * lanes_n * 4; }
};

// Tensor cores, TF32 (the operands are rounded already): 64 x 64 weights per warp, 8 rows a step.
// Neurons 2 g and 2 g + 1 are rows g and g + 8 of a tensor cores' tile: a thread reads both at once,
// into the registers that take them. Rows of a stage are eight banks apart, so that the lanes read
// from different banks.
template <int Rows, int Columns, int StageRows, int Stages>
struct MmaWeights {
  static constexpr int threads = 256, M = Rows, N = Columns;
  static constexpr int stage_rows = StageRows, stages = Stages;
  static constexpr int groups = 8 * 64 * 64 / (M * N);
  static constexpr int padding = 8;
  static constexpr int step_rows = 8;
  static constexpr int values = 128;
  static constexpr int blocks = 1;
  using Run = float2;

  static __device__ int warp() { return threadIdx.x % (threads / groups) / 32; }
  static __device__ int lane_g() { return threadIdx.x % 32 / 4; }
  static __device__ int lane_t() { return threadIdx.x % 4; }
  static __device__ int row0() { return warp() / (N / 64) * 64 + lane_g() * 2; }
  static __device__ int column0() { return warp() % (N / 64) * 64; }

  struct Operands {
    float g[4][4], a[8][2];
  };
  static __device__ void load(const float* G, const float* A, Operands& o) {
#pragma unroll
    for (int half = 0; half < 2; ++half) {
      const int row = lane_t() + half * 4;
#pragma unroll
      for (int m = 0; m < 4; ++m) {
        const float* at = G + row * (M + padding) + row0() + m * 16;
        const float2 v = *reinterpret_cast<const float2*>(at);
        o.g[m][2 * half] = v.x, o.g[m][2 * half + 1] = v.y;
      }
#pragma unroll
      for (int n = 0; n < 8; ++n)
        o.a[n][half] = A[row * (N + padding) + column0() + lane_g() + n * 8];
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
  static __device__ int row_of(int q) { return row0() + q / 16 * 16 + q % 2; }
  static __device__ int column_of(int q) { return column0() + q / 2 % 8 * 8 + lane_t() * 2; }
};

// A thread's share of the rows of a panel, W neurons of each, on their way into the ring.
template <class P, int H, int W>
class PanelStream {
 public:
  static constexpr int ld = W + P::padding;

  // `from` is the first row, `to` its place in the first stage.
  __device__ PanelStream(const float* from, const float* to)
      : from_(from + row() * H + column()),
        to_(static_cast<unsigned>(__cvta_generic_to_shared(to + row() * ld + column()))) {}

  // The next rows, `left` of them, then zeros; `stage` is an offset in floats.
  __device__ void fetch(int stage, int left) {
    if (left >= P::stage_rows) {
#pragma unroll
      for (int i = 0; i < P::stage_rows; i += down) copy(stage, i);
    } else {
#pragma unroll
      for (int i = 0; i < P::stage_rows; i += down) copy(stage, i, row() + i < left ? 16 : 0);
    }
    from_ += P::stage_rows * H;
  }

 private:
  static constexpr int across = W / 4, down = P::threads / across;
  static_assert(P::stage_rows % down == 0, "a stage takes whole passes of the block");

  static __device__ int row() { return threadIdx.x / across; }
  static __device__ int column() { return threadIdx.x % across * 4; }
  __device__ void copy(int stage, int i) {
    asm volatile("cp.async.cg.shared.global.L2::128B [%0], [%1], 16;" ::"r"(to_ + 4 * stage +
                                                                            4 * i * ld),
                 "l"(from_ + i * H)
                 : "memory");
  }
  __device__ void copy(int stage, int i, int bytes) {
    asm volatile("cp.async.cg.shared.global.L2::128B [%0], [%1], 16, %2;" ::"r"(to_ + 4 * stage +
                                                                                4 * i * ld),
                 "l"(from_ + i * H), "r"(bytes)
                 : "memory");
  }

  const float* from_;
  unsigned to_;
};

template <class P>
constexpr int weights_memory() {
  const int ring = P::stages * P::stage_rows * (P::M + P::N + 2 * P::padding);
  const int sums = (P::groups - 1) * P::M * P::N;
  return 4 * (ring > sums ? ring : sums);
}

// blockIdx = (tile of weights, split of the rows, member x layer)
template <class P, int H>
__global__ void __launch_bounds__(P::threads, P::blocks)
    weights_kernel(const __grid_constant__ Plan plan, const Scratch scratch, const Chunk chunk) {
  extern __shared__ __align__(16) float shared[];
  constexpr int G_size = P::stage_rows * (P::M + P::padding);
  constexpr int stage_size = G_size + P::stage_rows * (P::N + P::padding);
  constexpr int steps = P::stage_rows / (P::groups * P::step_rows);
  static_assert(steps % 2 == 0, "operands of a stage's last step are in the second buffer");
  const int out0 = blockIdx.x / (H / P::N) * P::M, in0 = blockIdx.x % (H / P::N) * P::N;
  const int rows = chunk.count * plan.rows;
  const std::int64_t all = (rows + P::stage_rows - 1) / P::stage_rows;
  const int begin = static_cast<int>(blockIdx.y * all / plan.splits);
  const int end = static_cast<int>((blockIdx.y + 1) * all / plan.splits);
  const std::int64_t first = blockIdx.z * plan.panel() + std::int64_t(begin) * P::stage_rows * H;
  PanelStream<P, H, P::M> G(scratch.adjoints + first + out0, shared);
  PanelStream<P, H, P::N> A(scratch.activations + first + in0, shared + G_size);

  const auto fetch = [&](int s, int stage) {
    if (s < end) {
      G.fetch(stage, rows - s * P::stage_rows);
      A.fetch(stage, rows - s * P::stage_rows);
    }
    __pipeline_commit();
  };
  const int group = threadIdx.x / (P::threads / P::groups);
  const auto load = [&](int stage, int step, typename P::Operands& operands) {
    const float* at = shared + stage;
    const int row = (group * steps + step) * P::step_rows;
    P::load(at + row * G.ld, at + G_size + row * A.ld, operands);
  };

  for (int i = 0; i < P::stages; ++i) fetch(begin + i, i * stage_size);
  __pipeline_wait_prior(P::stages - 1);
  __syncthreads();
  typename P::Operands operands[2];
  float sum[P::values] = {};
  int stage = 0;
  load(stage, 0, operands[0]);
  for (int s = begin; s < end; ++s) {
#pragma unroll
    for (int step = 0; step < steps; ++step) {
      if (step + 1 < steps) {
        load(stage, step + 1, operands[(step + 1) % 2]);
      } else {  // all have read this stage: another takes its place
        __pipeline_wait_prior(P::stages - 2);
        __syncthreads();
        const int next = stage == (P::stages - 1) * stage_size ? 0 : stage + stage_size;
        load(next, 0, operands[0]);
        fetch(s + P::stages, stage);
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
