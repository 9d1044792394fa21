// The Newton-Schulz iteration in plain float32 or float64, for matrices that
// newton_schulz_cluster.cu does not compute: one launch for the norms, three for each of 5 steps.
//
//   out = alpha (left right) + beta D:   A = X X^T,   P = c A A + b A,   X <- P X + a X
//
//                                 +-------------+
//                         kDepth  | right panel |      panels in shared memory, one after another
//                                 +-------------+      along the inner dimension
//               kDepth              32 columns
//            +------------+       +-------------+
//   32 rows  | left panel |       |   outputs   |      of a block: 8 x 16 threads (ty, tx)
//            +------------+       +-------------+
//
//   name         shape                       where
//   left, right  [32][kPitch]                shared; kDepth: 512 bytes of a row
//   sum          [M][N] = [4][2]             registers; rows ty + 8 i, columns tx + 16 j
//   X, Y, A, P   [r, c] twice, [r, r] twice  global scratch, for each matrix; r <= c
//
// A symmetric product computes the tiles on and below the diagonal, and stores them twice.
#include <type_traits>

#include "newton_schulz.h"

namespace granpinn::cuda {

namespace {

constexpr int kTile = 32;
constexpr int kColumns = 16, kRows = 8;  // threads of a block
constexpr int kThreads = kColumns * kRows;
constexpr int kNormThreads = 512;

// Values that a thread reads from shared memory at once, 16 bytes.
template <class T>
struct alignas(16) Pack {
  static constexpr int N = 16 / static_cast<int>(sizeof(T));
  T v[N];
};

template <class T>
constexpr int kDepth = 512 / static_cast<int>(sizeof(T));  // columns of a panel

template <class T>
constexpr int kPitch = kDepth<T> + Pack<T>::N;  // rows of a panel lie in different banks

// X = G / |G|, transposed if `tall`; a block for each matrix.
template <class T>
__global__ void __launch_bounds__(kNormThreads) normalize_kernel(const NewtonSchulz<T> a, T* X) {
  __shared__ double sums[kNormThreads];
  const std::int64_t k = blockIdx.x, size = a.m * a.n;
  const T* G = a.G + k / a.count * a.group_stride + k % a.count * a.stride;
  double sum = 0;
  for (std::int64_t i = threadIdx.x; i < size; i += kNormThreads)
    sum += static_cast<double>(G[i]) * static_cast<double>(G[i]);
  sums[threadIdx.x] = sum;
  for (int half = kNormThreads / 2; half > 0; half /= 2) {
    __syncthreads();
    if (threadIdx.x < half) sums[threadIdx.x] += sums[threadIdx.x + half];
  }
  __syncthreads();
  const T scale = static_cast<T>(sums[0] > 0 ? 1 / sqrt(sums[0]) : 1.0);
  const bool tall = a.m > a.n;
  for (std::int64_t i = threadIdx.x; i < size; i += kNormThreads) {
    const std::int64_t to = tall ? i % a.n * a.m + i / a.n : i;
    X[k * size + to] = scale * G[i];
  }
}

template <class T>
struct Product {
  const T *left, *right;  // [rows, inner]; [inner, columns], or its transpose
  const T* D;             // [rows, columns] or null
  T* out;                 // [rows, columns], or its transpose
  int rows, inner, columns;
  bool flipped;     // right is stored as [columns, inner]
  bool symmetric;   // the product is symmetric: half of the tiles are copies
  bool transposed;  // out is stored as [columns, rows]
  T alpha, beta;
};

// Loads rows [first, first + kTile) and columns [from, from + kDepth) of a matrix; zeros beyond its
// end. across: distance between rows; along: distance between columns.
template <class T>
__device__ void load_panel(const T* matrix, int first, int rows, int from, int columns, int across,
                           int along, T* panel) {
  // neighbouring threads read neighbouring values
  for (int i = threadIdx.x; i < kTile * kDepth<T>; i += kThreads) {
    const int row = along == 1 ? i / kDepth<T> : i % kTile;
    const int column = along == 1 ? i % kDepth<T> : i / kTile;
    const int r = first + row, c = from + column;
    const bool inside = r < rows && c < columns;
    panel[row * kPitch<T> + column] =
        inside
            ? matrix[static_cast<std::int64_t>(r) * across + static_cast<std::int64_t>(c) * along]
            : T(0);
  }
}

template <class T>
__device__ Pack<T> load_pack(const T* from) {
  return *reinterpret_cast<const Pack<T>*>(from);
}

template <class T>
__global__ void __launch_bounds__(kThreads) product_kernel(const Product<T> p) {
  if (p.symmetric && blockIdx.x > blockIdx.y) return;
  __shared__ alignas(16) T left[kTile * kPitch<T>];
  __shared__ alignas(16) T right[kTile * kPitch<T>];
  constexpr int M = kTile / kRows, N = kTile / kColumns;  // outputs of a thread
  const int row0 = blockIdx.y * kTile, column0 = blockIdx.x * kTile;
  const int ty = threadIdx.x / kColumns, tx = threadIdx.x % kColumns;
  const std::int64_t k = blockIdx.z;
  const std::int64_t area = static_cast<std::int64_t>(p.rows) * p.columns;
  const T* A = p.left + k * p.rows * p.inner;
  const T* B = p.right + k * p.columns * p.inner;
  T sum[M][N] = {};
  for (int from = 0; from < p.inner; from += kDepth<T>) {
    if (from > 0) __syncthreads();
    load_panel(A, row0, p.rows, from, p.inner, p.inner, 1, left);
    load_panel(B, column0, p.columns, from, p.inner, p.flipped ? p.inner : 1,
               p.flipped ? 1 : p.columns, right);
    __syncthreads();
    const int depth = min(kDepth<T>, p.inner - from);
    for (int at = 0; at < depth; at += Pack<T>::N) {
      Pack<T> a[M], b[N];
      for (int i = 0; i < M; ++i) a[i] = load_pack(left + (ty + kRows * i) * kPitch<T> + at);
      for (int j = 0; j < N; ++j) b[j] = load_pack(right + (tx + kColumns * j) * kPitch<T> + at);
      for (int e = 0; e < Pack<T>::N; ++e)
        for (int i = 0; i < M; ++i)
          for (int j = 0; j < N; ++j) sum[i][j] += a[i].v[e] * b[j].v[e];
    }
  }
  for (int i = 0; i < M; ++i)
    for (int j = 0; j < N; ++j) {
      const int row = row0 + ty + kRows * i, column = column0 + tx + kColumns * j;
      if (row >= p.rows || column >= p.columns) continue;
      const std::int64_t at = static_cast<std::int64_t>(row) * p.columns + column;
      const std::int64_t mirrored = static_cast<std::int64_t>(column) * p.rows + row;
      T value = p.alpha * sum[i][j];
      if (p.D) value += p.beta * p.D[k * area + at];
      p.out[k * area + (p.transposed ? mirrored : at)] = value;
      if (p.symmetric && blockIdx.x < blockIdx.y) p.out[k * area + mirrored] = value;
    }
}

template <class T>
cudaError_t launch(const Product<T>& p, std::int64_t matrices, cudaStream_t stream) {
  const dim3 grid((p.columns + kTile - 1) / kTile, (p.rows + kTile - 1) / kTile,
                  static_cast<unsigned>(matrices));
  product_kernel<T><<<grid, kThreads, 0, stream>>>(p);
  return cudaGetLastError();
}

}  // namespace

template <class T>
cudaError_t newton_schulz(const NewtonSchulz<T>& a, cudaStream_t stream) {
  if constexpr (std::is_same_v<T, float>)
    if (newton_schulz_fits_clusters(a) && newton_schulz_has_clusters())
      return newton_schulz_in_clusters(a, stream);
  const std::int64_t K = a.groups * a.count;
  const bool tall = a.m > a.n;
  const int r = static_cast<int>(tall ? a.n : a.m), c = static_cast<int>(tall ? a.m : a.n);
  T *X = a.scratch, *Y = X + K * r * c, *A = Y + K * r * c, *P = A + K * r * r;
  normalize_kernel<T><<<static_cast<unsigned>(K), kNormThreads, 0, stream>>>(a, X);
  cudaError_t status = cudaGetLastError();
  const T first = T(3.4445), second = T(-4.7750), third = T(2.0315);
  for (int step = 0; step < 5 && status == cudaSuccess; ++step) {
    const bool last = step == 4;
    status = launch<T>({X, X, nullptr, A, r, c, r, true, true, false, T(1), T(0)}, K, stream);
    if (status != cudaSuccess) break;
    status = launch<T>({A, A, A, P, r, r, r, true, true, false, third, second}, K, stream);
    if (status != cudaSuccess) break;
    status = launch<T>(
        {P, X, X, last ? a.out : Y, r, r, c, false, false, last && tall, T(1), first}, K, stream);
    T* done = X;
    X = Y;
    Y = done;
  }
  return status;
}

template cudaError_t newton_schulz<float>(const NewtonSchulz<float>&, cudaStream_t);
template cudaError_t newton_schulz<double>(const NewtonSchulz<double>&, cudaStream_t);

}  // namespace granpinn::cuda
