// The whole Newton-Schulz iteration in one launch, float32, sides up to 128:
//
//   A = X X^T,   P = b A + c A^2,   X <- a X + P X,   from X = G / |G|_F, five times
//
// A thread-block cluster computes a matrix, each of its 2, 4 or 8 blocks 16 rows of A, P and X.
//
//   A = X X^T, 8 blocks      column tile  0  1  2  3  4  5  6  7
//                            block 0      D  x  x  x  o  .  .  .    D  diagonal tile, 16 x 16
//                            block 1      .  D  x  x  x  o  .  .    x  computed, stored twice
//                            block 2      .  .  D  x  x  x  o  .    o  computed by both blocks
//                             ...                                   .  stored by another block
//                            block 7      x  x  x  o  .  .  .  D
//
//   name  shape               where                 contents
//   X     [128][kPitch]       shared, every block   whole X: X X^T and P X need it
//   A     [16][kPitch]        shared                own rows of A
//   ring  [4 warps][3][4][.]  shared                tiles of A that are fetched ahead
//   P     [16][kPitch]        shared                own rows of P
//   sums  [4 warps][64][32]   shared, in A's place  sums of the warps, see add_warps
//   X, A  [16 blocks][128]    global scratch (L2)   new rows, for the other blocks
//
// New rows of A and X go through the second-level cache: it gives a block more bytes per cycle than
// the shared memory of its neighbours.
//
// A product has 16 x 128 outputs for a block. The four warps share the terms of the sums, and each
// lane has 8 x 8 of the outputs: four reads of 16 bytes feed 64 multiplications. Then add_warps
// adds the warps' sums in order. A warp fetches the values of its terms, and waits for these alone.
#include <cooperative_groups.h>

#include "cluster_terms.cuh"
#include "newton_schulz.h"

namespace granpinn::cuda {

namespace {

using namespace cluster;

// After this barrier, a block sees all earlier writes of the cluster's blocks.
__device__ void cluster_barrier() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  cooperative_groups::this_cluster().sync();
#else
  __trap();  // never launched on such a GPU: newton_schulz_has_clusters
#endif
}

// X = G / |G|_F, padded with zeros, transposed if tall. Every block computes all of X.
__device__ void normalize(const Place& at, const NewtonSchulz<float>& a, const float* G,
                          Memory& s) {
  const bool tall = a.m > a.n;
  const int rows = at.blocks * kRows, thread = threadIdx.x;
  const int m = static_cast<int>(a.m), n = static_cast<int>(a.n);
  const int count = !tall ? rows : thread < rows ? kSide : 0;
  const int first = tall ? thread * kPitch : thread, apart = tall ? 1 : kPitch;
  // a thread starts the copies of all its values, then waits for these alone
#pragma unroll 8
  for (int i = 0; i < count; ++i) {
    const bool inside = i < m && thread < n;
    fetch_value(s.X + first + i * apart, inside ? G + i * n + thread : G, inside);
  }
  commit();
  wait_for<0>();
  double part[4] = {};
#pragma unroll 4
  for (int i = 0; i < count; ++i) {
    const double value = s.X[first + i * apart];
    part[i % 4] += value * value;
  }
  double sum = (part[0] + part[1]) + (part[2] + part[3]);
  for (int lanes = 16; lanes > 0; lanes /= 2) sum += __shfl_xor_sync(~0u, sum, lanes);
  if (at.lane == 0) s.norms[at.warp] = sum;
  __syncthreads();
  sum = s.norms[0] + s.norms[1] + s.norms[2] + s.norms[3];
  const float scale = static_cast<float>(sum > 0 ? 1 / sqrt(sum) : 1.0);
#pragma unroll 8
  for (int i = 0; i < count; ++i) s.X[first + i * apart] *= scale;
  __syncthreads();
}

// Starts the copies of X. Warp w fetches columns [32 w, 32 w + 32), in the order in which its terms
// of X X^T need them.
__device__ void fetch_X(const Place& at, const float* from, Memory& s) {
  for (int q = 0; q < 4; ++q) {
    const int k = 32 * at.warp + 8 * q + at.lane % 2 * 4;
    for (int t = 0; t < min(kTiles, at.blocks); ++t) {
      const int row = at.tile(t) + at.lane / 2;
      fetch(s.X + row * kPitch + k, from + row * kSide + k);
    }
    commit();
  }
  const int k = 32 * at.warp + at.lane % 8 * 4;
  for (int row = kTiles * kRows + at.lane / 8; row < at.blocks * kRows; row += 4) {
    const int to = (at.tile(0) + row) & (at.blocks * kRows - 1);
    fetch(s.X + to * kPitch + k, from + to * kSide + k);
  }
  commit();
}

// Stores the block's tiles of A = X X^T to global memory. To be called after fetch_X, or when no
// copy is under way.
__device__ void gram(const Place& at, Memory& s, float* A) {
  float sum[8][kTiles] = {};
  GramTerms even, odd;
  const int k = 32 * at.warp;
  wait_for<4>();
  even.load(at, s.X, k);
#pragma unroll 1
  for (int q = 0; q < 32; q += 8) {
    odd.load(at, s.X, k + q + 4);
    even.add_to(sum);
    wait_for<3>();
    if (q < 24) even.load(at, s.X, k + q + 8);
    odd.add_to(sum);
    commit();  // an empty group, so that the next one to wait for is always the fourth youngest
  }
  wait_for<0>();
  float made[2][kTiles];
  add_warps(sum, made, s);
#pragma unroll
  for (int t = 0; t < kTiles; ++t) {
    const int i = at.tile(0) + 4 * at.warp, j = at.tile(t) + at.column;
    if (t > at.blocks / 2) continue;
#pragma unroll
    for (int d = 0; d < 2; ++d) A[(i + 2 * d + at.row) * kSide + j] = made[d][t];
    if (t == 0 || t == at.blocks / 2) continue;  // the other block makes that tile itself
    const float odd0 = __shfl_xor_sync(~0u, made[0][t], 16);
    const float odd1 = __shfl_xor_sync(~0u, made[1][t], 16);
    if (at.row == 0) store4(A + j * kSide + i, make_float4(made[0][t], odd0, made[1][t], odd1));
  }
}

// Starts the copy of rows 4 w .. 4 w + 3 of tile t of A: the terms of A^2 for warp w.
__device__ void fetch_terms(const Place& at, const float* A, int t, Memory& s) {
  if (t < at.blocks && at.fetches())
    for (int e = 0; e < 4; ++e)
      fetch(s.A.ring[at.warp][t % kAhead] + e * kPitch + 4 * at.lane,
            A + (at.tile(t) + 4 * at.warp + e) * kSide + 4 * at.lane);
  commit();
}

// The block's rows of P = b A + c A^2, from A in global memory. Columns beyond those of a small A
// are neither written nor fetched. Their values in shared memory are undefined, and no term of P X
// uses them.
__device__ void polynomial(const Place& at, const float* A, Memory& s, float b, float c) {
  if (at.fetches())
    for (int e = at.warp; e < kRows; e += kWarps)
      fetch(s.A.own + e * kPitch + 4 * at.lane, A + (at.tile(0) + e) * kSide + 4 * at.lane);
  commit();
  for (int t = 1; t <= kAhead; ++t) fetch_terms(at, A, t, s);
  float sum[8][8] = {};
  Terms even, odd;
  const float* left = s.A.own + at.row * kPitch + 4 * at.warp;
  const auto load = [&](Terms& terms, int t) {
    wait_for<kAhead - 1>();  // the two tiles after t may be under way
    terms.load(left + at.tile(t), s.A.ring[at.warp][t % kAhead] + 4 * at.column);
    __syncwarp();
    fetch_terms(at, A, t + kAhead, s);
  };
  wait_for<kAhead>();
  __syncthreads();
  even.load(left + at.tile(0), s.A.own + 4 * at.warp * kPitch + 4 * at.column);
#pragma unroll 1
  for (int t = 0; t < at.blocks; t += 2) {
    load(odd, t + 1);
    even.add_to(sum);
    if (t + 2 < at.blocks) load(even, t + 2);
    odd.add_to(sum);
  }
  wait_for<0>();
  float A_ij[2][8], made[2][8];
  read_outputs(at, s.A.own, A_ij);
  add_warps(sum, made, s);
#pragma unroll
  for (int i = 0; i < 16; ++i) made[i / 8][i % 8] = c * made[i / 8][i % 8] + b * A_ij[i / 8][i % 8];
  write_outputs(at, made, s.P, kPitch);
  __syncthreads();
}

// The block's rows of a X + P X.
__device__ void advance(const Place& at, Memory& s, float a, float (&made)[2][8]) {
  float sum[8][8] = {};
  Terms even, odd;
  const float* left = s.P + at.row * kPitch + 4 * at.warp;
  const float* right = s.X + 4 * at.warp * kPitch + 4 * at.column;
  even.load(left, right);
#pragma unroll 1
  for (int k = 0; k < at.blocks * kRows; k += 2 * kRows) {
    odd.load(left + k + kRows, right + (k + kRows) * kPitch);
    even.add_to(sum);
    if (k + 2 * kRows < at.blocks * kRows)
      even.load(left + k + 2 * kRows, right + (k + 2 * kRows) * kPitch);
    odd.add_to(sum);
  }
  float X_ij[2][8];
  read_outputs(at, s.X + at.tile(0) * kPitch, X_ij);
  add_warps(sum, made, s);
#pragma unroll
  for (int i = 0; i < 16; ++i) made[i / 8][i % 8] += a * X_ij[i / 8][i % 8];
}

__global__ void __launch_bounds__(kThreads, 2)
    cluster_kernel(const NewtonSchulz<float> a, const int blocks) {
  extern __shared__ float4 memory[];
  Memory& s = *reinterpret_cast<Memory*>(memory);
  const int lane = threadIdx.x % 32;
  const Place at{static_cast<int>(blockIdx.x) % blocks,
                 blocks,
                 static_cast<int>(threadIdx.x) / 32,
                 lane,
                 lane / 16,
                 lane % 16};
  const std::int64_t matrix = blockIdx.x / blocks;
  float* X = a.scratch + matrix * 2 * blocks * kRows * kSide;
  float* A = X + blocks * kRows * kSide;
  normalize(at, a, a.G + matrix / a.count * a.group_stride + matrix % a.count * a.stride, s);
  float made[2][8];
#pragma unroll 1
  for (int step = 0;; ++step) {
    gram(at, s, A);
    cluster_barrier();
    polynomial(at, A, s, -4.7750f, 2.0315f);
    advance(at, s, 3.4445f, made);
    if (step == 4) break;
    write_outputs(at, made, X + at.tile(0) * kSide, kSide);
    cluster_barrier();
    fetch_X(at, X, s);
  }
  const bool tall = a.m > a.n;
  const int m = static_cast<int>(a.m), n = static_cast<int>(a.n);
  float* out = a.out + matrix * m * n;
#pragma unroll
  for (int v = 0; v < 16; ++v) {
    const int i = at.tile(0) + 4 * at.warp + v / 8 * 2 + at.row;
    const int j = v / 4 % 2 * 64 + 4 * at.column + v % 4;
    if (i < (tall ? n : m) && j < (tall ? m : n))
      out[tall ? j * n + i : i * n + j] = made[v / 8][v % 8];
  }
}

}  // namespace

bool newton_schulz_has_clusters() {
  cudaFuncAttributes f{};
  // code compiled for an older GPU has no clusters, even on a newer GPU
  return cudaFuncGetAttributes(&f, cluster_kernel) == cudaSuccess && f.ptxVersion >= 90;
}

cudaError_t newton_schulz_in_clusters(const NewtonSchulz<float>& a, cudaStream_t stream) {
  const int blocks = newton_schulz_blocks(a.m, a.n);
  const std::size_t bytes = sizeof(Memory) - (kSide - blocks * kRows) * kPitch * sizeof(float);
  cudaError_t error = cudaFuncSetAttribute(
      cluster_kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes));
  if (error != cudaSuccess) return error;
  // two blocks fit on a multiprocessor if nearly all its fast memory is shared memory
  error = cudaFuncSetAttribute(cluster_kernel, cudaFuncAttributePreferredSharedMemoryCarveout,
                               cudaSharedmemCarveoutMaxShared);
  if (error != cudaSuccess) return error;
  cudaLaunchAttribute shape{};
  shape.id = cudaLaunchAttributeClusterDimension;
  shape.val.clusterDim.x = static_cast<unsigned>(blocks);
  shape.val.clusterDim.y = shape.val.clusterDim.z = 1;
  cudaLaunchConfig_t launch{};
  launch.gridDim = dim3(static_cast<unsigned>(a.groups * a.count * blocks));
  launch.blockDim = dim3(kThreads);
  launch.dynamicSmemBytes = bytes;
  launch.stream = stream;
  launch.attrs = &shape;
  launch.numAttrs = 1;
  return cudaLaunchKernelEx(&launch, cluster_kernel, a, blocks);
}

}  // namespace granpinn::cuda
