// The kernels of an optimization step (csrc/step.h): a row of blocks for every member.
//
// A kernel that may note a fault of one kind tests for faults before that kind: what its own blocks
// note meanwhile changes nothing.
#include "launch_after.cuh"
#include "step_launch.h"
#include "step_note.cuh"

namespace granpinn::cuda {

namespace {

constexpr int kThreads = 256;
constexpr std::int64_t kMostBlocks = 1024;  // for a member

__device__ std::int64_t first_index() {
  return static_cast<std::int64_t>(blockIdx.x) * kThreads + threadIdx.x;
}

__device__ std::int64_t stride() { return static_cast<std::int64_t>(gridDim.x) * kThreads; }

// Blocks for `count` elements of each of so many members.
dim3 grid_of(std::int64_t count, std::int64_t members) {
  std::int64_t blocks = (count + kThreads - 1) / kThreads;
  if (blocks > kMostBlocks) blocks = kMostBlocks;
  if (blocks < 1) blocks = 1;
  return dim3(static_cast<unsigned>(blocks), static_cast<unsigned>(members));
}

template <class T>
__global__ void __launch_bounds__(kThreads) draw_kernel(const BatchArguments<T> a) {
  wait_for_earlier();
  const std::int64_t e = blockIdx.y, step = a.control.counter[0];
  const std::int64_t count = a.interior + a.surface;
  for (std::int64_t i = first_index(); i <= count; i += stride()) {
    if (i < a.interior)
      draw_point(a, e, i, step);
    else if (i < count)
      draw_surface_point(a, e, i - a.interior, step);
    else
      weigh_terms(a, e, step);
  }
}

template <class T>
__global__ void __launch_bounds__(kThreads) check_kernel(const CheckArguments<T> a) {
  wait_for_earlier();
  const std::int64_t e = blockIdx.y, step = a.control.counter[0];
  bool bad = false;
  for (std::int64_t i = first_index(); i < a.P; i += stride())
    bad |= !finite(a.grad_params[e * a.P + i]);
  bad = __syncthreads_or(bad);
  if (threadIdx.x != 0) return;
  std::int64_t* fault = a.members.fault + e;
  if (bad) note(fault, step, kGradient);
  if (blockIdx.x != 0) return;
  if (!finite(a.loss[e])) note(fault, step, kLoss);
  for (int i = 0; i < 3; ++i)
    if (!finite(a.grad_theta[3 * e + i])) note(fault, step, kLawGradient);
  if (e == 0) a.control.counter[2] = step;
}

template <class T>
__device__ bool in_matrix(const UpdateArguments<T>& a, std::int64_t i) {
  bool matrix = false;
  for (int r = 0; r < a.regions && i >= a.region[r].begin; ++r)
    matrix |= i < a.region[r].begin + a.region[r].size;
  return matrix;
}

template <class T>
__global__ void __launch_bounds__(kThreads) update_kernel(const UpdateArguments<T> a) {
  wait_for_earlier();
  __shared__ T step_size, root_scale;
  const std::int64_t e = blockIdx.y, step = a.control.counter[0];
  if (a.members.frozen(e, step, kParams)) return;
  const T momentum = static_cast<T>(a.momentum);
  AdamRates<T> rates{};
  bool known = false, good = true;
  for (std::int64_t i = first_index(); i - threadIdx.x < a.P; i += stride()) {
    const std::int64_t at = e * a.P + i;
    const bool inside = i < a.P, matrix = inside && in_matrix(a, i), other = inside && !matrix;
    const T gradient = inside ? a.gradient[at] : T(0);
    T first = inside ? a.first[at] : T(0), second = other ? a.second[at] : T(0);
    T param = other ? a.params[at] : T(0), direction;
    if (!known) {  // two warps make the rates while values are on their way
      const auto t = static_cast<double>(a.members.counts[2 * e] + 1);
      if (threadIdx.x == 0)
        step_size = adam_step_size<T>(a.adam, a.control.row(step)[0] * a.members.slower[e], t);
      if (threadIdx.x == 32) root_scale = adam_root_scale<T>(a.adam, t);
      __syncthreads();
      rates = adam_rates_from(a.adam, step_size, root_scale);
      known = true;
    }
    if (matrix) {
      good &= accumulate(momentum, gradient, &first, &direction);
      a.direction[at] = direction;
    } else if (other) {
      good &= adam(rates, gradient, &param, &first, &second);
      a.params[at] = param;
      a.second[at] = second;
    }
    if (inside) a.first[at] = first;
  }
  if (!good) note(a.members.fault + e, step, kParams);
}

template <class T>
__global__ void __launch_bounds__(kThreads) descend_kernel(const DescendArguments<T> a) {
  wait_for_earlier();
  const std::int64_t e = blockIdx.y, step = a.control.counter[0];
  if (a.members.frozen(e, step, kParams)) return;
  const T rate = static_cast<T>(a.learning_rate * a.control.row(step)[0] * a.members.slower[e]);
  const std::int64_t count = a.count * a.size;
  T* params = a.params + e * a.P + a.offset;
  bool good = true;
  for (std::int64_t i = first_index(); i < count; i += stride())
    good &= descend(rate, a.U[e * count + i], params + i / a.size * a.apart + i % a.size);
  if (!good) note(a.members.fault + e, step, kParams);
}

template <class T>
__global__ void __launch_bounds__(kThreads) finish_kernel(const FinishArguments<T> a) {
  wait_for_earlier();
  const std::int64_t e = blockIdx.y, step = a.control.counter[2];
  if (e == 0 && blockIdx.x == 0 && threadIdx.x == 0) a.control.counter[0] = step + 1;
  if (a.members.frozen(e, step, kLawScalars)) return;
  if (blockIdx.x == 0 && threadIdx.x == 0) finish_law(a, e, step);
  const T weight = static_cast<T>(a.control.row(step)[1]);
  if (!(weight > T(0))) return;
  for (std::int64_t i = first_index(); i < a.P; i += stride()) {
    T* average = a.average_params + e * a.P + i;
    *average = interpolate(*average, a.params[e * a.P + i], weight);
  }
}

}  // namespace

template <class T>
cudaError_t draw_batch(const BatchArguments<T>& a, cudaStream_t stream) {
  if (a.control.members == 0) return cudaSuccess;
  const dim3 grid = grid_of(a.interior + a.surface + 1, a.control.members);
  return launch_after(draw_kernel<T>, grid, kThreads, 0, stream, a);
}

template <class T>
cudaError_t check_step(const CheckArguments<T>& a, cudaStream_t stream) {
  if (a.control.members == 0) return cudaSuccess;
  return launch_after(check_kernel<T>, grid_of(a.P, a.control.members), kThreads, 0, stream, a);
}

template <class T>
cudaError_t update_params(const UpdateArguments<T>& a, cudaStream_t stream) {
  if (a.control.members == 0) return cudaSuccess;
  return launch_after(update_kernel<T>, grid_of(a.P, a.control.members), kThreads, 0, stream, a);
}

template <class T>
cudaError_t descend_matrices(const DescendArguments<T>& a, cudaStream_t stream) {
  if (a.control.members == 0 || a.count * a.size == 0) return cudaSuccess;
  return launch_after(descend_kernel<T>, grid_of(a.count * a.size, a.control.members), kThreads, 0,
                      stream, a);
}

template <class T>
cudaError_t finish_step(const FinishArguments<T>& a, cudaStream_t stream) {
  if (a.control.members == 0) return cudaSuccess;
  return launch_after(finish_kernel<T>, grid_of(a.P, a.control.members), kThreads, 0, stream, a);
}

#define GRANPINN_INSTANTIATE(T)                                                       \
  template cudaError_t draw_batch<T>(const BatchArguments<T>&, cudaStream_t);         \
  template cudaError_t check_step<T>(const CheckArguments<T>&, cudaStream_t);         \
  template cudaError_t update_params<T>(const UpdateArguments<T>&, cudaStream_t);     \
  template cudaError_t descend_matrices<T>(const DescendArguments<T>&, cudaStream_t); \
  template cudaError_t finish_step<T>(const FinishArguments<T>&, cudaStream_t);

GRANPINN_INSTANTIATE(float)
GRANPINN_INSTANTIATE(double)

}  // namespace granpinn::cuda
