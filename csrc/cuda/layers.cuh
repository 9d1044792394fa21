// The kernels between the matrix products of a network, on panels [members][C][points][width].
//
//   kernel            computes                                         grid
//   input_panel       jets of the mapped coordinates                   3 points x members
//   activate          A = f(Z)                                         points width x members
//   activate_adjoint  A = f(Z) again, and dL/dZ from dL/dA             points width x members
//   column_sums       dL/db of a slice of rows                         width x 1 x members slices
//   add_partials      total += sum over slices, in double              parameters x members
//   round_total       T from the totals in double                      all parameters
#pragma once

#include "launch.h"
#include "launcher.cuh"
#include "math/jet.h"

namespace granpinn::cuda {

constexpr int kThreads = 256;

// Jets of the mapped coordinates, (xi_i, scale_i e_i, 0): panel [members][C][points][3].
template <int C, class T>
__global__ void input_panel(const __grid_constant__ InputMap<T> map, Batched<T> points,
                            std::int64_t first_member, std::int64_t begin, std::int64_t count,
                            T* panel) {
  const std::int64_t at = static_cast<std::int64_t>(blockIdx.x) * kThreads + threadIdx.x;
  if (at >= 3 * count) return;
  const std::int64_t e = first_member + blockIdx.y;
  const int i = static_cast<int>(at % 3);
  const T scale = map.scale_of(e, i), x = points.member(e)[3 * begin + at];
  T* to = panel + blockIdx.y * C * 3 * count + at;
  to[0] = (x - map.shift_of(e, i)) * scale;
  for (int c = 1; c < C; ++c) to[c * 3 * count] = c == i + 1 ? scale : T(0);
}

// a = f(z) for jets; `size` = points * width.
template <int C, class T>
__global__ void activate(const T* z, T* a, std::int64_t size) {
  const std::int64_t at = static_cast<std::int64_t>(blockIdx.x) * kThreads + threadIdx.x;
  if (at >= size) return;
  const std::int64_t from = blockIdx.y * C * size + at;
  T zc[C], ac[C];
  for (int c = 0; c < C; ++c) zc[c] = z[from + c * size];
  activation_jet<C>(zc, ac);
  for (int c = 0; c < C; ++c) a[from + c * size] = ac[c];
}

// The adjoint of `activate`: from z and g = dL/da, computes a, and replaces g by dL/dz.
template <int C, class T>
__global__ void activate_adjoint(const T* z, T* a, T* g, std::int64_t size) {
  const std::int64_t at = static_cast<std::int64_t>(blockIdx.x) * kThreads + threadIdx.x;
  if (at >= size) return;
  const std::int64_t from = blockIdx.y * C * size + at;
  T zc[C], ac[C], gc[C];
  for (int c = 0; c < C; ++c) {
    zc[c] = z[from + c * size];
    gc[c] = g[from + c * size];
  }
  activation_jet_adjoint<C>(zc, ac, gc);
  for (int c = 0; c < C; ++c) {
    a[from + c * size] = ac[c];
    g[from + c * size] = gc[c];
  }
}

constexpr int kColumns = 32, kLanes = 8;

// Gradient of the biases: for each slice, the sum of its value rows of g.
template <class T>
__global__ void column_sums(const T* g, std::int64_t g_batch, int rows, int width, int slices,
                            int slice, T* out, std::int64_t out_batch) {
  __shared__ T sums[kLanes][kColumns];
  const int column = blockIdx.x * kColumns + threadIdx.x;
  const int member = blockIdx.z / slices, first = (blockIdx.z % slices) * slice;
  const T* from = g + member * g_batch + column;
  T sum(0);
  if (column < width)
    for (int row = first + threadIdx.y; row < min(rows, first + slice); row += kLanes)
      sum += from[static_cast<std::int64_t>(row) * width];
  sums[threadIdx.y][threadIdx.x] = sum;
  for (int half = kLanes / 2; half > 0; half /= 2) {
    __syncthreads();
    if (threadIdx.y < half) sums[threadIdx.y][threadIdx.x] += sums[threadIdx.y + half][threadIdx.x];
  }
  if (threadIdx.y == 0 && column < width)
    out[blockIdx.z * out_batch + column] = sums[0][threadIdx.x];
}

// Adds the partial gradients [members][slices][size] of a layer to its part of the total.
template <class T>
__global__ void add_partials(const T* partial, int slices, std::int64_t size, double* total,
                             std::int64_t total_batch) {
  const std::int64_t at = static_cast<std::int64_t>(blockIdx.x) * kThreads + threadIdx.x;
  if (at >= size) return;
  const T* from = partial + blockIdx.y * slices * size + at;
  double sum = 0;
#pragma unroll 4
  for (int s = 0; s < slices; ++s) sum += static_cast<double>(from[s * size]);
  total[blockIdx.y * total_batch + at] += sum;
}

template <class T>
__global__ void round_total(const double* total, std::int64_t size, T* out) {
  const std::int64_t at = static_cast<std::int64_t>(blockIdx.x) * kThreads + threadIdx.x;
  if (at < size) out[at] = static_cast<T>(total[at]);
}

}  // namespace granpinn::cuda
