// Gradient of the hidden weights: G^T A, summed over the rows of a chunk.
//
// A block computes a tile of B x B weights over a share of the rows; its threads form groups that
// take turns at the rows of a stage and are added up in fixed order.
#pragma once

#include "mma_engine.cuh"

namespace granpinn::cuda::fused {

constexpr int kWeightsThreads = 256;
constexpr int kStageRows = 16;
constexpr int kWeightsStages = 4;

// Plain float32: 8 x 8 weights per thread.
template <int B>
struct SimtWeights {
  static constexpr int groups = kWeightsThreads / ((B / 8) * (B / 8));
  static constexpr int ld = B;
  static constexpr int values = 64;
  static constexpr int rows = kStageRows / groups;  // of a stage, for one group

  // A warp is 4 x 8 threads, its lanes numbered so that i and i ^ 1 read the same row, i and i ^ 2
  // the same column: the hardware then merges 16-byte loads in pairs. A group has B / 64 warps
  // across and B / 32 down. A thread has two runs of four neurons each way, half a tile apart.
  static __device__ int row(int i) {
    const int lane = threadIdx.x % 32, warp = threadIdx.x / 32 % (B / 64 * (B / 32));
    const int at = lane / 2 % 2 + lane / 16 * 2 + warp / (B / 64) * 4;
    return at * 4 + i % 4 + i / 4 * (B / 2);
  }
  static __device__ int column(int j) {
    const int lane = threadIdx.x % 32, warp = threadIdx.x / 32 % (B / 64);
    const int at = lane % 2 + lane / 4 % 4 * 2 + warp * 8;
    return at * 4 + j % 4 + j / 4 * (B / 2);
  }
  static __device__ int row_of(int v) { return row(v / 8); }
  static __device__ int column_of(int v) { return column(v % 8); }

  static __device__ void add(const float* G, const float* A, float (&sum)[values]) {
#pragma unroll
    for (int r = 0; r < rows; ++r) {
      float g[8], a[8];
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        const float4 gv = *reinterpret_cast<const float4*>(G + r * ld + row(4 * half));
        const float4 av = *reinterpret_cast<const float4*>(A + r * ld + column(4 * half));
        g[4 * half] = gv.x, g[4 * half + 1] = gv.y, g[4 * half + 2] = gv.z, g[4 * half + 3] = gv.w;
        a[4 * half] = av.x, a[4 * half + 1] = av.y, a[4 * half + 2] = av.z, a[4 * half + 3] = av.w;
      }
#pragma unroll
      for (int v = 0; v < values; ++v) sum[v] = fmaf(g[v / 8], a[v % 8], sum[v]);
    }
  }
};

__device__ inline void mma_tf32(float* d, const float (&a)[4], const float (&b)[2]) {
  asm("mma.sync.aligned.m16n8k8.row.col.f32.tf32.tf32.f32 {%0,%1,%2,%3}, {%4,%5,%6,%7}, {%8,%9}, "
      "{%0,%1,%2,%3};"
      : "+f"(d[0]), "+f"(d[1]), "+f"(d[2]), "+f"(d[3])
      : "r"(__float_as_uint(a[0])), "r"(__float_as_uint(a[1])), "r"(__float_as_uint(a[2])),
        "r"(__float_as_uint(a[3])), "r"(__float_as_uint(b[0])), "r"(__float_as_uint(b[1])));
}

// Tensor cores, TF32: the operands are rounded already.
template <int B>
struct MmaWeights {
  static constexpr int groups = B == 128 ? 1 : 2;
  static constexpr int ld = B + 8;  // rows eight banks apart
  static constexpr int rows = kStageRows / groups;
  static constexpr int warps = 8 / groups;  // of a group
  static constexpr int across = warps / 2;  // 2 x across warps
  static constexpr int tiles_m = B / 2 / 16, tiles_n = B / across / 8;
  static constexpr int values = tiles_m * tiles_n * 4;

  static __device__ int lane() { return threadIdx.x % 32; }
  static __device__ int warp() { return threadIdx.x / 32 % warps; }
  static __device__ int row0() { return warp() % 2 * (B / 2); }
  static __device__ int column0() { return warp() / 2 * (B / across); }
  static __device__ int row_of(int v) {
    return row0() + v / (4 * tiles_n) * 16 + lane() / 4 + v % 4 / 2 * 8;
  }
  static __device__ int column_of(int v) {
    return column0() + v / 4 % tiles_n * 8 + lane() % 4 * 2 + v % 2;
  }

  static __device__ void add(const float* G, const float* A, float (&sum)[values]) {
    const int g = lane() / 4, t = lane() % 4;
#pragma unroll
    for (int r = 0; r < rows; r += 8) {
      float a[tiles_m][4], b[tiles_n][2];
#pragma unroll
      for (int m = 0; m < tiles_m; ++m) {
        const float* at = G + (r + t) * ld + row0() + m * 16 + g;
        a[m][0] = at[0], a[m][1] = at[8], a[m][2] = at[4 * ld], a[m][3] = at[4 * ld + 8];
      }
#pragma unroll
      for (int n = 0; n < tiles_n; ++n) {
        const float* at = A + (r + t) * ld + column0() + n * 8 + g;
        b[n][0] = at[0], b[n][1] = at[4 * ld];
      }
#pragma unroll
      for (int m = 0; m < tiles_m; ++m)
#pragma unroll
        for (int n = 0; n < tiles_n; ++n) {
          mma_tf32(sum + (m * tiles_n + n) * 4, a[m], b[n]);
        }
    }
  }
};

template <class P, int B>
constexpr int weights_memory() {
  const int stages = kWeightsStages * 2 * kStageRows * P::ld;
  return 4 * (stages > B * B ? stages : B * B);
}

// blockIdx = (tile of weights, split of the rows, member x layer)
template <class P, int H, int B>
__global__ void __launch_bounds__(kWeightsThreads, 2)
    weights_kernel(const __grid_constant__ Plan plan, const Scratch scratch, const Chunk chunk) {
  extern __shared__ __align__(16) float shared[];
  const int out0 = blockIdx.x / (H / B) * B, in0 = blockIdx.x % (H / B) * B;
  const std::int64_t rows = std::int64_t(chunk.count) * plan.tile.rows;
  const std::int64_t stages = (rows + kStageRows - 1) / kStageRows;
  const std::int64_t begin = blockIdx.y * stages / plan.splits;
  const std::int64_t end = (blockIdx.y + 1) * stages / plan.splits;
  const float* G = scratch.adjoints + blockIdx.z * plan.panel() + out0;
  const float* A = scratch.activations + blockIdx.z * plan.panel() + in0;
  constexpr int stage_size = 2 * kStageRows * P::ld;

  const auto fetch = [&](std::int64_t s) {
    float* to = shared + s % kWeightsStages * stage_size;
    if (s < end)
      for (int i = threadIdx.x; i < 2 * kStageRows * B / 4; i += kWeightsThreads) {
        const int which = i / (kStageRows * B / 4), r = i / (B / 4) % kStageRows;
        const int column = i % (B / 4) * 4;
        const std::int64_t row = s * kStageRows + r;
        const bool there = row < rows;
        const float* from = (which ? A : G) + (there ? row : 0) * H + column;
        __pipeline_memcpy_async(to + (which * kStageRows + r) * P::ld + column, from, 16,
                                there ? 0 : 16);
      }
    __pipeline_commit();
  };

  const int group = threadIdx.x / (kWeightsThreads / P::groups);
  float sum[P::values] = {};
  for (int i = 0; i < kWeightsStages - 1; ++i) fetch(begin + i);
  for (std::int64_t s = begin; s < end; ++s) {
    __pipeline_wait_prior(kWeightsStages - 2);
    __syncthreads();
    fetch(s + kWeightsStages - 1);
    const float* stage = shared + s % kWeightsStages * stage_size + group * P::rows * P::ld;
    P::add(stage, stage + kStageRows * P::ld, sum);
  }
  __pipeline_wait_prior(0);

  // the groups, one after another
  for (int g = 1; g < P::groups; ++g) {
    __syncthreads();
    if (group == g)
      for (int v = 0; v < P::values; ++v) shared[P::row_of(v) * B + P::column_of(v)] = sum[v];
    __syncthreads();
    if (group == 0)
      for (int v = 0; v < P::values; ++v) sum[v] += shared[P::row_of(v) * B + P::column_of(v)];
  }
  if (group != 0) return;
  float* to = scratch.gradients + (std::int64_t(blockIdx.z) * plan.splits + blockIdx.y) * H * H;
  for (int v = 0; v < P::values; ++v) {
    float& total = to[(out0 + P::row_of(v)) * H + in0 + P::column_of(v)];
    total = (chunk.begin == 0 ? 0 : total) + sum[v];
  }
}

}  // namespace granpinn::cuda::fused
