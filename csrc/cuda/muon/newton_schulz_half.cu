// The whole Newton-Schulz iteration of a matrix in one block, sides up to 128, on tensor cores:
//
//   A = X X^T,   P = b A + c A^2,   X <- a X + P X,   from X = G / |G|_F, five times
//
//   name     shape             where      layout
//   staging  128 x 128 float   shared     `place`; G, then W
//   X        128 x 128 float   registers  pairs of the iteration (iteration.cuh); U at last
//   A, P, X  128 x 128 halves  shared     squares of the iteration
//
// Operands of products are rounded to half precision. It has the eleven significant bits of TF32,
// and its range suffices: |X|_F = 1 at first, and no singular value exceeds 1.3 later. X itself
// stays in float32 registers: its rounding errors grow by the factor a in every step, as small
// singular values do. The rounded new X takes the place of A, and the next A that of the old X.
//
// Code for compute capability 9.0 alone ("90a") has the iteration of warpgroup_iteration.cuh, any
// other code that of warp_iteration.cuh.
#include <cuda_pipeline_primitives.h>

#include "../launch_after.cuh"
#include "../step_note.cuh"
#include "newton_schulz.h"
#include "warp_iteration.cuh"
#include "warpgroup_iteration.cuh"

namespace granpinn::cuda {

namespace {

// Whether the staging area has shared memory of its own. Elsewhere the squares A and P lie in it.
#ifdef __CUDA_ARCH_FEAT_SM90_ALL
using Iteration = warpgroup::WarpgroupIteration;
constexpr bool kApart = true;
#else
using Iteration = half_square::WarpIteration;
constexpr bool kApart = false;
#endif

constexpr int kBytes = half_square::kBytes;
static_assert(kBytes == warpgroup::kBytes, "squares of either iteration");
constexpr int kWarps = 8, kThreads = 32 * kWarps;
constexpr int kIterations = 5;
constexpr int kStagingBytes = 4 * kSide * kSide;

// Position of a number in the staging area. Eight columns of four rows lie in different banks.
__device__ int place(int row, int column) { return row * kSide + (column ^ row % 4 * 8); }

__device__ double sum_of(double value, double* sums) {
  for (int lanes = 16; lanes > 0; lanes /= 2) value += __shfl_xor_sync(~0u, value, lanes);
  if (threadIdx.x % 32 == 0) sums[threadIdx.x / 32] = value;
  __syncthreads();
  value = 0;
  for (int w = 0; w < kWarps; ++w) value += sums[w];
  __syncthreads();
  return value;
}

// An m x n matrix in global memory, of any alignment. The staging area holds it, or its transpose
// if it is tall.
template <class T>
struct Matrix {
  T* values;
  int m, n;

  // Calls f(from, at) for the thread's numbers: the number, and its place in the staging area.
  template <class F>
  __device__ void each(F f) const {
    const int column = threadIdx.x % kSide;
    if (column >= n) return;
#pragma unroll 8
    for (int row = threadIdx.x / kSide; row < m; row += kThreads / kSide)
      f(values + row * n + column, m > n ? place(column, row) : place(row, column));
  }
  // Begins to copy the matrix to the staging area, which is padded with zeros.
  __device__ void fetch(float* staging) const {
    if (m < kSide || n < kSide) {
      for (int i = threadIdx.x; i < kSide * kSide; i += kThreads) staging[i] = 0;
      __syncthreads();
    }
    each([=](const float* from, int at) { __pipeline_memcpy_async(staging + at, from, 4); });
    __pipeline_commit();
  }
};

// Waits for what all threads fetched.
__device__ void wait_for_fetched() {
  __pipeline_wait_prior(0);
  __syncthreads();
}

// Calls f(x, s) for the thread's pairs: of the iteration, and in the staging area.
template <class F>
__device__ void each_pair(Iteration& x, float* staging, F f) {
#pragma unroll
  for (int v = 0; v < kPairs; ++v) f(x.pair(v), staging + place(x.row(v), x.column(v)));
}

// X = X / |X|_F, unless it is zero.
__device__ void normalize(Iteration& x, double* sums) {
  float part[4] = {};
#pragma unroll
  for (int v = 0; v < 2 * kPairs; ++v) {
    const float value = x.pair(v / 2)[v % 2];
    part[v % 4] += value * value;
  }
  double sum = sum_of((part[0] + part[1]) + (part[2] + part[3]), sums);
  if (!(sum > 1e-30 && sum < 1e30)) {  // too small or too large to be squared in float32
    sum = 0;
#pragma unroll
    for (int v = 0; v < 2 * kPairs; ++v) {
      const double wide = x.pair(v / 2)[v % 2];
      sum += wide * wide;
    }
    sum = sum_of(sum, sums);
  }
  const float scale = static_cast<float>(sum > 0 ? 1 / sqrt(sum) : 1.0);
#pragma unroll
  for (int v = 0; v < 2 * kPairs; ++v) x.pair(v / 2)[v % 2] *= scale;
}

// U of the matrix in the staging area. Calls `refill` once that area is free, after all else if the
// squares lie in it.
template <class F>
__device__ void orthogonalize(Iteration& x, unsigned char* memory, int m, int n, F refill) {
  float* staging = reinterpret_cast<float*>(memory);
  const unsigned first =
      static_cast<unsigned>(__cvta_generic_to_shared(memory)) + (kApart ? kStagingBytes : 0);
  const int rows = (min(m, n) + 15) / 16, columns = (max(m, n) + 15) / 16;
  each_pair(x, staging, [](float* pair, const float* s) { pair[0] = s[0], pair[1] = s[1]; });
  normalize(x, reinterpret_cast<double*>(memory + kStagingBytes));
  if constexpr (kApart) refill();
  const unsigned P = first;
  unsigned A = first + kBytes, X = first + 2 * kBytes;
  x.store(X);
  x.publish();
#pragma unroll 1
  for (int i = 0;; ++i) {
    x.advance(A, P, X, rows, columns);
    if (i == kIterations - 1) break;
    x.store(A);
    x.publish();
    const unsigned made = A;
    A = X;
    X = made;
  }
  if constexpr (!kApart) {
    __syncthreads();
    refill();
  }
}

// W -= rate U for one matrix. W is in the staging area.
__device__ void descend(const DescendArguments<float>& d, std::int64_t e, std::int64_t step,
                        Matrix<float> W, Iteration& x, float* staging) {
  const auto rate =
      static_cast<float>(d.learning_rate * d.control.row(step)[0] * d.members.lr_scale[e]);
  bool good = true;
  each_pair(x, staging, [&](const float* U, float* w) {
    good &= granpinn::descend(rate, U[0], w);
    good &= granpinn::descend(rate, U[1], w + 1);
  });
  if (!good) note(d.members.fault + e, step, kParams);
  __syncthreads();
  W.each([=](float* to, int at) { *to = staging[at]; });
}

template <bool Descends>
__global__ void __launch_bounds__(kThreads)
    half_kernel(const NewtonSchulz<float> a, const DescendArguments<float> d) {
  extern __shared__ __align__(1024) unsigned char memory[];
  float* staging = reinterpret_cast<float*>(memory);
  const int m = static_cast<int>(a.m), n = static_cast<int>(a.n);
  const std::int64_t matrix = blockIdx.x, e = matrix / a.count, l = matrix % a.count;
  wait_for_earlier();
  Matrix<const float>{a.G + e * a.group_stride + l * a.stride, m, n}.fetch(staging);
  const std::int64_t step = Descends ? d.control.updated() : 0;
  const bool frozen = Descends && d.members.frozen(e, step, kParams);
  wait_for_fetched();
  if (frozen) return;
  Iteration x;
  if constexpr (Descends) {
    const Matrix<float> W{d.params + e * d.P + d.offset + l * d.apart, m, n};
    orthogonalize(x, memory, m, n, [&] { W.fetch(staging); });
    wait_for_fetched();
    descend(d, e, step, W, x, staging);
  } else {
    orthogonalize(x, memory, m, n, [] {});
    each_pair(x, staging, [](const float* pair, float* s) { s[0] = pair[0], s[1] = pair[1]; });
    __syncthreads();
    Matrix<float>{a.out + matrix * m * n, m, n}.each([=](float* to, int at) { *to = staging[at]; });
  }
}

template <bool Descends>
cudaError_t launch(const NewtonSchulz<float>& a, const DescendArguments<float>& d,
                   cudaStream_t stream) {
  const auto kernel = half_kernel<Descends>;
  cudaFuncAttributes code{};
  if (const cudaError_t error = cudaFuncGetAttributes(&code, kernel)) return error;
  const int bytes = 3 * kBytes + (code.binaryVersion == 90 ? kStagingBytes : 0);  // see kApart
  if (const cudaError_t error =
          cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes))
    return error;
  return launch_after(kernel, dim3(static_cast<unsigned>(a.groups * a.count)), kThreads, bytes,
                      stream, a, d);
}

}  // namespace

cudaError_t newton_schulz_in_half(const NewtonSchulz<float>& a, cudaStream_t stream) {
  return launch<false>(a, {}, stream);
}
cudaError_t descend_in_half(const NewtonSchulz<float>& a, const DescendArguments<float>& d,
                            cudaStream_t stream) {
  return launch<true>(a, d, stream);
}

}  // namespace granpinn::cuda
