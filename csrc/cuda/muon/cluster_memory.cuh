// Shared memory of a block of newton_schulz_cluster.cu, and how values get in and out of it.
#pragma once

#include <cuda_runtime.h>

namespace granpinn::cuda::cluster {

constexpr int kSide = 128;         // X and A have so many columns, with zeros
constexpr int kRows = 16;          // of X, A and P that a block makes
constexpr int kTiles = 5;          // of X X^T that a block makes, of at most 8 around the diagonal
constexpr int kPitch = kSide + 4;  // eight rows lie in different banks
constexpr int kSlab = kRows * kPitch;
constexpr int kWarps = 4, kThreads = 32 * kWarps;
constexpr int kAhead = 3;  // tiles of A asked for before they are needed

struct RowsOfA {
  float own[kSlab];
  float ring[kWarps][kAhead][4 * kPitch];
};

struct Memory {
  union {
    RowsOfA A;
    float sums[kWarps * 64 * 32];  // of the warps, when A is done with
  };
  float P[kSlab];
  double norms[kWarps];
  float X[kSide * kPitch];  // a cluster of few blocks has fewer rows
};

__device__ inline float4 load4(const float* from) { return *reinterpret_cast<const float4*>(from); }
__device__ inline void store4(float* to, float4 v) { *reinterpret_cast<float4*>(to) = v; }

// `i` is known to the compiler.
__device__ inline float component(const float4& v, int i) {
  return i == 0 ? v.x : i == 1 ? v.y : i == 2 ? v.z : v.w;
}

// 16 bytes from global to shared memory, later, past the first-level cache.
__device__ inline void fetch(float* to, const float* from) {
  const unsigned address = static_cast<unsigned>(__cvta_generic_to_shared(to));
  asm volatile("cp.async.cg.shared.global [%0], [%1], 16;" ::"r"(address), "l"(from) : "memory");
}
// One value likewise; zero if it is not `inside` its matrix.
__device__ inline void fetch_value(float* to, const float* from, bool inside) {
  const unsigned address = static_cast<unsigned>(__cvta_generic_to_shared(to));
  asm volatile("cp.async.ca.shared.global [%0], [%1], 4, %2;" ::"r"(address), "l"(from),
               "r"(inside ? 4 : 0)
               : "memory");
}
// What a lane asked for since the last commit becomes a group.
__device__ inline void commit() { asm volatile("cp.async.commit_group;" ::: "memory"); }
// Until at most so many groups of each lane of the warp, the youngest, are under way.
template <int Groups>
__device__ inline void wait_for() {
  asm volatile("cp.async.wait_group %0;" ::"n"(Groups) : "memory");
  __syncwarp();
}

// Adds what the warps have of the sums; a lane gets rows s = 2 warp, 2 warp + 1 of its outputs.
// The memory of A is overwritten.
template <int N>
__device__ inline void add_warps(const float (&sum)[8][N], float (&made)[2][N], Memory& memory) {
  constexpr int Wide = N % 4 == 0 ? 4 : 1;  // values that are moved at once
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
