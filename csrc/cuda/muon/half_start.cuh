// What the half-precision Newton-Schulz iteration begins with: X = G / |G|.
#pragma once

#include "half_square.cuh"
#include "newton_schulz.h"

namespace granpinn::cuda::half_square {

constexpr float kA = 3.4445f, kB = -4.7750f, kC = 2.0315f;
constexpr int kWarps = 8, kThreads = 32 * kWarps;
constexpr int kApart = kThreads / kSide, kCount = kSide / kApart;  // rows of G for a thread

// Where a float32 square in shared memory has a number; eight columns of four rows lie in different
// banks.
__device__ inline int place(int row, int column) { return row * kSide + (column ^ row % 4 * 8); }

__device__ inline double sum_of(double value, double* sums) {
  for (int lanes = 16; lanes > 0; lanes /= 2) value += __shfl_xor_sync(~0u, value, lanes);
  if (threadIdx.x % 32 == 0) sums[threadIdx.x / 32] = value;
  __syncthreads();
  value = 0;
  for (int w = 0; w < kWarps; ++w) value += sums[w];
  __syncthreads();
  return value;
}

// X = G / |G|, padded with zeros, transposed if tall, rounded and not; a thread has half a column.
__device__ inline void normalize(const NewtonSchulz<float>& a, const float* G, unsigned X,
                                 float* exact) {
  auto* sums = reinterpret_cast<double*>(exact);
  const int column = threadIdx.x % kSide, first = threadIdx.x / kSide;
  const int m = static_cast<int>(a.m), n = static_cast<int>(a.n);
  float value[kCount], part[4] = {};
#pragma unroll
  for (int i = 0; i < kCount; ++i) {
    const int row = first + i * kApart;
    value[i] = row < m && column < n ? G[row * n + column] : 0.0f;
  }
#pragma unroll
  for (int i = 0; i < kCount; ++i) part[i % 4] += value[i] * value[i];
  double sum = sum_of((part[0] + part[1]) + (part[2] + part[3]), sums);
  if (!(sum > 1e-30 && sum < 1e30)) {  // too small or too large to be squared in float32
    sum = 0;
#pragma unroll 1
    for (int i = first; i < m && column < n; i += kApart) {
      const double wide = G[i * n + column];
      sum += wide * wide;
    }
    sum = sum_of(sum, sums);
  }
  const float scale = static_cast<float>(sum > 0 ? 1 / sqrt(sum) : 1.0);
#pragma unroll
  for (int i = 0; i < kCount; ++i) {
    const int row = first + i * kApart, to = m > n ? column : row, along = m > n ? row : column;
    const unsigned at = X + to * kRowBytes + (along / 8 ^ to % 8) * 16 + along % 8 * 2;
    value[i] *= scale;
    exact[place(to, along)] = value[i];
    const __half rounded = __float2half_rn(value[i]);
    asm volatile("st.shared.u16 [%0], %1;" ::"r"(at), "h"(__half_as_ushort(rounded)) : "memory");
  }
  __syncthreads();
}

}  // namespace granpinn::cuda::half_square
