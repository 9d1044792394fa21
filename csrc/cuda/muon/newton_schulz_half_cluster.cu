// newton_schulz_half.cu with a cluster of four blocks for each matrix, where few of them would
// leave most of the GPU idle: 32 rows of X, A and P for each block, the same sums, same order.
//
// Every block keeps X and A whole in shared memory, as operands. New rows of them go through the
// second-level cache, which hands a block more bytes per cycle than the shared memory of its
// neighbours does. A warp has 16 columns of its block's rows.
#include <cooperative_groups.h>

#include "../launch_after.cuh"
#include "../step_note.cuh"
#include "half_start.cuh"

namespace granpinn::cuda {

namespace {

using namespace half_square;

constexpr int kBlocks = 4, kRows = kSide / kBlocks;
constexpr std::int64_t kMost = 64;  // matrices: two blocks for each multiprocessor
constexpr std::int64_t kNumbers = 2 * kBytes / sizeof(float);  // of the scratch of a matrix
constexpr unsigned kStep = 16 * kRowBytes;                     // sixteen rows of a square

// All writes of the cluster's blocks before it are seen after it.
__device__ void cluster_barrier() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  cooperative_groups::this_cluster().sync();
#else
  __trap();  // newton_schulz_half_scratch says that this kernel is not for such a GPU
#endif
}

// A warp's part of a stripe of 32 rows, 32 x 16 numbers.
struct Stripe {
  int rank, warp, lane;

  struct Terms {
    Fragment left[2], right[1];
  };

  // Left rows of the stripe, columns 16 k; right its columns, as rows of a square, or flipped.
  template <bool Flipped>
  __device__ void load(Terms& t, unsigned left, unsigned right, int k) const {
    const unsigned own = (left + left_lane(lane)) ^ (k % 8 * 32);
#pragma unroll
    for (int i = 0; i < 2; ++i) t.left[i] = half_square::load(own + (2 * rank + i) * kStep);
    if (Flipped)
      t.right[0] = load_flipped((right + left_lane(lane) + k % 8 * kStep) ^ (warp * 32));
    else
      t.right[0] = half_square::load(((right + right_lane(lane)) ^ (k % 8 * 32)) + warp * kStep);
  }
  // sums += left right, `steps` times 16 terms
  template <bool Flipped>
  __device__ void add_product(Sum (&sums)[2][2], unsigned left, unsigned right, int steps) const {
    Terms even, odd;
    load<Flipped>(even, left, right, 0);
#pragma unroll 2
    for (int k = 0; k < steps; k += 2) {
      load<Flipped>(odd, left, right, k + 1);
      multiply_add<2, 1>(sums, even.left, even.right);
      load<Flipped>(even, left, right, k + 2);
      multiply_add<2, 1>(sums, odd.left, odd.right);
    }
  }
  __device__ void store(unsigned square, const Sum (&sums)[2][2]) const {
    store_tile<2, 2, false>(square, 2 * rank, 2 * warp, lane, sums);
  }
  // f(number, its row, its column, which one of the lane's sixteen it is)
  template <class F>
  __device__ void each(Sum (&sums)[2][2], F f) const {
#pragma unroll
    for (int v = 0; v < 16; ++v) {
      const int i = v / 8, j = v / 4 % 2, h = v / 2 % 2, c = v % 2;
      f(sums[i][j][2 * h + c], kRows * rank + 16 * i + 8 * h + lane / 4,
        16 * warp + 8 * j + lane % 4 * 2 + c, v);
    }
  }
};

// New rows to the block's square and, by way of global memory, to those of the others; theirs too.
__device__ void exchange(const Stripe& stripe, const Sum (&sums)[2][2], unsigned char* global,
                         unsigned square) {
  stripe.store(square, sums);
  const int lane = stripe.lane;
#pragma unroll
  for (int v = 0; v < 8; ++v) {
    const int i = v / 4, j = v / 2 % 2, h = v % 2;
    const int row = kRows * stripe.rank + 16 * i + 8 * h + lane / 4;
    const int column = 16 * stripe.warp + 8 * j + lane % 4 * 2;
    *reinterpret_cast<unsigned*>(global + row * kRowBytes + 2 * column) =
        pack(sums[i][j][2 * h], sums[i][j][2 * h + 1]);
  }
  cluster_barrier();
  const int chunk = threadIdx.x % 16;
#pragma unroll
  for (int i = 0; i < kSide - kRows; i += kThreads / 16) {
    const int row = (kRows * (stripe.rank + 1) + i + threadIdx.x / 16) % kSide;
    const unsigned to = square + row * kRowBytes + (chunk ^ row % 8) * 16;
    const unsigned char* from = global + row * kRowBytes + chunk * 16;
    asm volatile("cp.async.cg.shared.global [%0], [%1], 16;" ::"r"(to), "l"(from) : "memory");
  }
  asm volatile("cp.async.wait_all;" ::: "memory");
  __syncthreads();
}

template <bool Descends>
__global__ void __launch_bounds__(kThreads, 2)
    half_cluster_kernel(const NewtonSchulz<float> a, const DescendArguments<float> d) {
  extern __shared__ __align__(256) unsigned char memory[];
  wait_for_earlier();
  const std::int64_t matrix = blockIdx.x / kBlocks, e = matrix / a.count, l = matrix % a.count;
  const std::int64_t step = Descends ? d.control.counter[2] : 0;
  if (Descends && d.members.frozen(e, step, kParams)) return;
  const int m = static_cast<int>(a.m), n = static_cast<int>(a.n);
  const int rows = (min(m, n) + 15) / 16, columns = (max(m, n) + 15) / 16;
  Stripe stripe{static_cast<int>(blockIdx.x) % kBlocks, static_cast<int>(threadIdx.x) / 32,
                static_cast<int>(threadIdx.x) % 32};
  const unsigned base = static_cast<unsigned>(__cvta_generic_to_shared(memory));
  unsigned A = base, X = base + 2 * kBytes;
  const unsigned P = base + kBytes;
  float* exact = reinterpret_cast<float*>(memory);  // where A and P will be
  normalize(a, a.G + e * a.group_stride + l * a.stride, X, exact);
  Sum part[2][2];
  float W[16] = {};
  const auto inside = [&](int row, int column) {
    return row < (m > n ? n : m) && column < (m > n ? m : n);
  };
  const auto index = [&](int row, int column) {
    return m > n ? column * n + row : row * n + column;
  };
  stripe.each(part, [&](float& x, int row, int column, int) { x = exact[place(row, column)]; });
  const std::int64_t from = e * d.P + d.offset + l * d.apart;  // in the parameters
  float* const to = Descends ? d.params + from : a.out + matrix * m * n;
  float rate = 0, weight = 0;
  if (Descends) {  // long before they are needed
    const double* control = d.control.row(step);
    rate = static_cast<float>(d.learning_rate * control[0] * d.members.slower[e]);
    weight = static_cast<float>(control[1]);
    stripe.each(part, [&](float&, int row, int column, int v) {
      if (inside(row, column)) W[v] = to[index(row, column)];
    });
  }
  __syncthreads();
  auto* scratch = reinterpret_cast<unsigned char*>(a.scratch + matrix * kNumbers);
#pragma unroll 1
  for (int i = 0;; ++i) {
    Sum sums[2][2] = {};
    stripe.add_product<false>(sums, X, X, columns);
    exchange(stripe, sums, scratch, A);
    stripe.each(sums, [](float& v, int, int, int) { v = kB / kC * v; });
    stripe.add_product<false>(sums, A, A, rows);
    stripe.each(sums, [](float& v, int, int, int) { v = kC * v; });
    stripe.store(P, sums);
    __syncthreads();
    stripe.each(part, [](float& v, int, int, int) { v *= kA; });
    stripe.add_product<true>(part, P, X, rows);
    if (i == 4) break;
    exchange(stripe, part, scratch + kBytes, A);
    const unsigned made = A;
    A = X;
    X = made;
  }
  // addresses are made again: to keep them would take more registers than there are
  asm volatile("" : "+r"(stripe.lane));
  bool good = true;
  stripe.each(part, [&](float& u, int row, int column, int v) {
    if (!inside(row, column)) return;
    if (Descends) good &= granpinn::descend(rate, u, W + v);
    to[index(row, column)] = Descends ? W[v] : u;
  });
  if (weight > 0) {
    float average[16];
    float* const averages = d.average_params + from;
    stripe.each(part, [&](float&, int row, int column, int v) {
      if (inside(row, column)) average[v] = averages[index(row, column)];
    });
    stripe.each(part, [&](float&, int row, int column, int v) {
      if (inside(row, column)) averages[index(row, column)] = interpolate(average[v], W[v], weight);
    });
  }
  if (Descends && !good) note(d.members.fault + e, step, kParams);
}

template <bool Descends>
cudaError_t launch(const NewtonSchulz<float>& a, const DescendArguments<float>& d,
                   cudaStream_t stream) {
  const auto kernel = half_cluster_kernel<Descends>;
  constexpr int bytes = 3 * kBytes;
  const cudaError_t error =
      cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes);
  if (error != cudaSuccess) return error;
  cudaLaunchAttribute attributes[2] = {};
  attributes[0].id = cudaLaunchAttributeClusterDimension;
  attributes[0].val.clusterDim.x = kBlocks;
  attributes[0].val.clusterDim.y = attributes[0].val.clusterDim.z = 1;
  attributes[1].id = cudaLaunchAttributeProgrammaticStreamSerialization;
  attributes[1].val.programmaticStreamSerializationAllowed = 1;
  cudaLaunchConfig_t launch{};
  launch.gridDim = dim3(static_cast<unsigned>(a.groups * a.count * kBlocks));
  launch.blockDim = dim3(kThreads);
  launch.dynamicSmemBytes = bytes;
  launch.stream = stream;
  launch.attrs = attributes;
  launch.numAttrs = 2;
  return cudaLaunchKernelEx(&launch, kernel, a, d);
}

}  // namespace

std::int64_t newton_schulz_half_scratch(const NewtonSchulz<float>& a) {
  const std::int64_t matrices = a.groups * a.count, side = a.m < a.n ? a.m : a.n;
  if (matrices > kMost || side <= kSide / 2) return 0;
  cudaFuncAttributes f{};
  // code for older GPUs has no clusters, also where it runs on a newer one
  const bool clusters =
      cudaFuncGetAttributes(&f, half_cluster_kernel<true>) == cudaSuccess && f.ptxVersion >= 90;
  return clusters ? matrices * kNumbers : 0;
}

cudaError_t newton_schulz_in_half_clusters(const NewtonSchulz<float>& a, cudaStream_t stream) {
  return launch<false>(a, {}, stream);
}
cudaError_t descend_in_half_clusters(const NewtonSchulz<float>& a, const DescendArguments<float>& d,
                                     cudaStream_t stream) {
  return launch<true>(a, d, stream);
}

}  // namespace granpinn::cuda
