// The whole Newton-Schulz iteration of a matrix in one block, sides up to 128, on tensor cores:
//
//   A = X X^T,   P = b A + c A^2,   X <- a X + P X,   from X = G / |G|_F, five times
//
//   X in registers, 128 x 128               A and P: half_polynomial.cuh
//           +--------------+--------------+
//     32    | warp 0       | warp 1       |
//           +--------------+--------------+
//     32    | warp 2       | warp 3       |   each warp 32 x 64: 2 x 8 tiles of m16n8k16
//           +--------------+--------------+
//            ...              64 columns
//
//   name     shape             where      layout
//   A, P, X  128 x 128 halves  shared     squares of half_square.cuh, 32 KiB each
//   exact    128 x 128 float   shared     `place`; G / |G| at first, U at last, where A and P are
//   Part::X  32 x 64 float     registers  [2][8][4] of a lane
//
// Operands of products are rounded to half precision. It has the eleven significant bits of TF32,
// and its range suffices: |X|_F = 1 at first, and no singular value exceeds 1.3 later. X itself
// stays in float32 registers: its rounding errors grow by the factor a in every step, as small
// singular values do. The rounded new X takes the place of A, and the next A that of the old X.
#include <type_traits>

#include "../launch_after.cuh"
#include "../step_note.cuh"
#include "half_polynomial.cuh"
#include "newton_schulz.h"

namespace granpinn::cuda {

namespace {

using namespace half_square;

constexpr float kA = 3.4445f, kB = -4.7750f, kC = 2.0315f;
constexpr int kWarps = 8, kThreads = 32 * kWarps;
constexpr int kApart = kThreads / kSide, kCount = kSide / kApart;  // a thread's rows of G

// Position of a number in a float32 square in shared memory. Eight columns of four rows lie in
// different banks.
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

// X = G / |G|_F, padded with zeros, transposed if tall: halves in X, float32 in exact. A thread has
// half a column of G.
__device__ void normalize(const NewtonSchulz<float>& a, const float* G, unsigned X, float* exact) {
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

// A <- X X^T, then P <- c (b/c A + A A^T). The first A stays in the accumulators, in float32. Warps
// 0 .. 3 are `near` the diagonal, see half_polynomial.cuh.
__device__ void polynomial(int warp, int lane, unsigned X, int columns, unsigned A, int rows,
                           unsigned P) {
  Band sums{warp % 4, lane, {}, {}};
  const auto add_product = [&](unsigned from, int steps, float factor, unsigned to, auto near) {
    sums.template add_product<decltype(near)::value>(from, steps);
    sums.each([=](float v) { return factor * v; });
    sums.template store<decltype(near)::value>(to);
  };
  const auto add = [&](unsigned from, int steps, float factor, unsigned to) {
    if (warp < 4)
      add_product(from, steps, factor, to, std::true_type{});
    else
      add_product(from, steps, factor, to, std::false_type{});
    __syncthreads();
  };
  add(X, columns, 1, A);
  sums.each([](float v) { return kB / kC * v; });
  add(A, rows, kC, P);
}

// A warp's 32 x 64 of X.
struct Part {
  int warp, lane;
  Sum X[2][8];

  struct Terms {
    Fragment left[2], right[4];
  };
  __device__ void load(Terms& t, unsigned P, unsigned rounded, int k) const {
    constexpr unsigned rows = 16 * kRowBytes;
    const unsigned own = (P + left_lane(lane)) ^ (k % 8 * 32);
    const unsigned down = rounded + left_lane(lane) + k % 8 * rows;
#pragma unroll
    for (int i = 0; i < 2; ++i) t.left[i] = half_square::load(own + (warp / 2 * 2 + i) * rows);
#pragma unroll
    for (int j = 0; j < 4; ++j) t.right[j] = load_flipped(down ^ ((warp % 2 * 4 + j) * 32));
  }
  // X <- a X + P X
  __device__ void advance(unsigned P, unsigned rounded, int steps) {
#pragma unroll
    for (int v = 0; v < 64; ++v) X[v / 32][v / 4 % 8][v % 4] *= kA;
    Terms even, odd;
    load(even, P, rounded, 0);
#pragma unroll 1
    for (int k = 0; k < steps; k += 2) {
      load(odd, P, rounded, k + 1);
      multiply_add<2, 4>(X, even.left, even.right);
      load(even, P, rounded, k + 2);
      multiply_add<2, 4>(X, odd.left, odd.right);
    }
  }
  __device__ void store(unsigned to) const {
    store_tile<2, 8, false>(to, warp / 2 * 2, warp % 2 * 8, lane, X);
  }
  // Calls f(x, at) for each pair of neighbours of X: the pair, and its place in a float32 square.
  template <class F>
  __device__ void each_pair(F f) {
#pragma unroll
    for (int v = 0; v < 32; ++v) {
      const int i = v / 16, j = v / 2 % 8, h = v % 2;
      f(X[i][j] + 2 * h,
        place(warp / 2 * 32 + 16 * i + 8 * h + lane / 4, warp % 2 * 64 + 8 * j + lane % 4 * 2));
    }
  }
};

// Copies U from shared memory to a.out.
__device__ void write(const NewtonSchulz<float>& a, std::int64_t matrix, const float* U) {
  const int m = static_cast<int>(a.m), n = static_cast<int>(a.n);
  float* out = a.out + matrix * m * n;
  const int column = threadIdx.x % kSide;
  if (column >= n) return;
#pragma unroll 8
  for (int row = threadIdx.x / kSide; row < m; row += kApart)
    out[row * n + column] = U[m > n ? place(column, row) : place(row, column)];
}

// W -= rate U, and the running average of W.
__device__ void descend(const NewtonSchulz<float>& a, const DescendArguments<float>& d,
                        std::int64_t matrix, std::int64_t step, const float* U) {
  constexpr int kBatch = 32;
  const int m = static_cast<int>(a.m), n = static_cast<int>(a.n);
  const std::int64_t e = matrix / a.count, l = matrix % a.count;
  const int column = threadIdx.x % kSide, first = threadIdx.x / kSide;
  const double* control = d.control.row(step);
  const auto rate = static_cast<float>(d.learning_rate * control[0] * d.members.lr_scale[e]);
  const auto weight = static_cast<float>(control[1]);
  const std::int64_t from = e * d.P + d.offset + l * d.apart + column;
  float *W = d.params + from, *average = d.average_params + from;
  bool good = true;
#pragma unroll 1
  for (int begin = first; begin < m && column < n; begin += kBatch * kApart) {
    float w[kBatch];
#pragma unroll
    for (int i = 0; i < kBatch; ++i)
      if (const int row = begin + i * kApart; row < m) w[i] = W[row * n];
#pragma unroll
    for (int i = 0; i < kBatch; ++i)
      if (const int row = begin + i * kApart; row < m) {
        const float u = U[m > n ? place(column, row) : place(row, column)];
        good &= granpinn::descend(rate, u, w + i);
        W[row * n] = w[i];
      }
    if (!(weight > 0)) continue;
#pragma unroll
    for (int i = 0; i < kBatch; ++i)
      if (const int row = begin + i * kApart; row < m)
        average[row * n] = interpolate(average[row * n], w[i], weight);
  }
  if (!good) note(d.members.fault + e, step, kParams);
}

template <bool Descends>
__global__ void __launch_bounds__(kThreads)
    half_kernel(const NewtonSchulz<float> a, const DescendArguments<float> d) {
  extern __shared__ __align__(256) unsigned char memory[];
  wait_for_earlier();
  const std::int64_t matrix = blockIdx.x, step = Descends ? d.control.updated() : 0;
  if (Descends && d.members.frozen(matrix / a.count, step, kParams)) return;
  const unsigned base = static_cast<unsigned>(__cvta_generic_to_shared(memory));
  const int warp = threadIdx.x / 32, lane = threadIdx.x % 32;
  const int rows = static_cast<int>(min(a.m, a.n) + 15) / 16;
  const int columns = static_cast<int>(max(a.m, a.n) + 15) / 16;
  unsigned A = base, X = base + 2 * kBytes;
  const unsigned P = base + kBytes;
  float* exact = reinterpret_cast<float*>(memory);  // overlaps A and P
  normalize(a, a.G + matrix / a.count * a.group_stride + matrix % a.count * a.stride, X, exact);
  Part part{warp, lane, {}};
  part.each_pair([&](float* x, int at) {
    const float2 both = *reinterpret_cast<const float2*>(exact + at);
    x[0] = both.x;
    x[1] = both.y;
  });
  __syncthreads();
#pragma unroll 1
  for (int i = 0;; ++i) {
    polynomial(warp, lane, X, columns, A, rows, P);
    part.advance(P, X, rows);
    if (i == 4) break;
    part.store(A);
    __syncthreads();
    const unsigned made = A;
    A = X;
    X = made;
  }
  __syncthreads();
  part.each_pair(
      [&](float* x, int at) { *reinterpret_cast<float2*>(exact + at) = make_float2(x[0], x[1]); });
  __syncthreads();
  if (Descends)
    descend(a, d, matrix, step, exact);
  else
    write(a, matrix, exact);
}

template <bool Descends>
cudaError_t launch(const NewtonSchulz<float>& a, const DescendArguments<float>& d,
                   cudaStream_t stream) {
  const auto kernel = half_kernel<Descends>;
  constexpr int bytes = 3 * kBytes;
  const cudaError_t error =
      cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes);
  if (error != cudaSuccess) return error;
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
