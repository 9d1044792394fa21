// Shared memory of a block of newton_schulz_cluster.cu, copies into it, and sums over its warps.
#pragma once

#include <cuda_runtime.h>

namespace granpinn::cuda::cluster {

constexpr int kSide = 128;         // columns of X and A, padded with zeros
constexpr int kRows = 16;          // rows of X, A and P that a block computes
constexpr int kTiles = 5;          // tiles of X X^T that a block computes, of at most 8 in its rows
constexpr int kPitch = kSide + 4;  // eight rows lie in different banks
constexpr int kSlab = kRows * kPitch;
constexpr int kWarps = 4, kThreads = 32 * kWarps;
constexpr int kAhead = 3;  // tiles of A that are fetched ahead

struct RowsOfA {
  float own[kSlab];
  float ring[kWarps][kAhead][4 * kPitch];
};

struct Memory {
  union {
    RowsOfA A;
    float sums[kWarps * 64 * 32];  // [warp][value][lane], when A is no longer needed
  };
  float P[kSlab];
  double norms[kWarps];
  float X[kSide * kPitch];  // the last member: with few blocks, fewer rows are allocated
};

__device__ inline float4 load4(const float* from) { return *reinterpret_cast<const float4*>(from); }
__device__ inline void store4(float* to, float4 v) { *reinterpret_cast<float4*>(to) = v; }

// i: a constant of the compiler.
__device__ inline float component(const float4& v, int i) {
  return i == 0 ? v.x : i == 1 ? v.y : i == 2 ? v.z : v.w;
}

// Starts a copy of 16 bytes from global to shared memory, past the first-level cache.
__device__ inline void fetch(float* to, const float* from) {
  const unsigned address = static_cast<unsigned>(__cvta_generic_to_shared(to));
  asm volatile("cp.async.cg.shared.global [%0], [%1], 16;" ::"r"(address), "l"(from) : "memory");
}
// Starts a copy of one value; writes zero if it is not `inside` its matrix.
__device__ inline void fetch_value(float* to, const float* from, bool inside) {
  const unsigned address = static_cast<unsigned>(__cvta_generic_to_shared(to));
  asm volatile("cp.async.ca.shared.global [%0], [%1], 4, %2;" ::"r"(address), "l"(from),
               "r"(inside ? 4 : 0)
               : "memory");
}
// The copies that a lane started since the last commit become a group.
__device__ inline void commit() { asm volatile("cp.async.commit_group;" ::: "memory"); }
// Waits until at most `Groups` groups of each lane of the warp, the youngest, are under way.
template <int Groups>
__device__ inline void wait_for() {
  asm volatile("cp.async.wait_group %0;" ::"n"(Groups) : "memory");
  __syncwarp();
}

// Adds the sums of the warps, in order. made: the total of sum[s] for s = 2 warp, 2 warp + 1.
// Overwrites the memory of A.
template <int N>
__device__ inline void add_warps(const float (&sum)[8][N], float (&made)[2][N], Memory& memory) {
  constexpr int Wide = N % 4 == 0 ? 4 : 1;  // values of one load or store
  const int warp = threadIdx.x / 32, lane = threadIdx.x % 32;
  const auto place = [&](int w, int value) {
    return memory.sums + ((w * 8 * N + value) * 32 + lane * Wide);
  };
  __syncthreads();
#pragma unroll
  for (int v = 0; v < 8 * N; v += Wide) {
    const int s = v / N, j = v % N;
    if constexpr (Wide == 4)
      store4(place(warp, v), make_float4(sum[s][j], sum[s][j + 1], sum[s][j + 2], sum[s][j + 3]));
    else
      *place(warp, v) = sum[s][j];
  }
  __syncthreads();
#pragma unroll
  for (int v = 0; v < 2 * N; v += Wide) {
    float total[Wide] = {};
#pragma unroll
    for (int w = 0; w < kWarps; ++w) {
      const float* from = place(w, 2 * N * warp + v);
      if constexpr (Wide == 4) {
        const float4 part = load4(from);
#pragma unroll
        for (int i = 0; i < 4; ++i) total[i] += component(part, i);
      } else {
        total[0] += *from;
      }
    }
#pragma unroll
    for (int i = 0; i < Wide; ++i) made[(v + i) / N][(v + i) % N] = total[i];
  }
}

}  // namespace granpinn::cuda::cluster
