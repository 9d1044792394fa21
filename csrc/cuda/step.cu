// The kernels of an optimization step (csrc/step.h). A member is one blockIdx.y.
//
//   kernel    blocks of a member                         work
//   draw      count / kThreads, at most kMostBlocks      points of the batch, weights of the terms
//   update    block 0                                    friction law; of member 0 also the step
//             blocks 1 ..                                momentum of matrices, Adam elsewhere
//   descend   count / kThreads, at most kMostBlocks      matrices: W -= rate U
//
// A kernel that may note a fault of kind k only tests for faults before k. So faults that its own
// blocks note while it runs do not change the result of that test.
#include "launch_after.cuh"
#include "step_launch.h"
#include "step_note.cuh"

namespace granpinn::cuda {

namespace {

constexpr int kThreads = 256;
constexpr int kEach = 4;                    // values of a thread, loaded before any is stored
constexpr std::int64_t kMostBlocks = 1024;  // of a member
constexpr int kMostPolls = 1 << 22;         // seconds; blocks arrive within microseconds

__device__ std::int64_t first_index() {
  return static_cast<std::int64_t>(blockIdx.x) * kThreads + threadIdx.x;
}

__device__ std::int64_t stride() { return static_cast<std::int64_t>(gridDim.x) * kThreads; }

// Grid for `count` elements of each member.
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

// Whether Muon updates parameter i, as an element of a matrix.
template <class T>
__device__ bool in_matrix(const UpdateArguments<T>& a, std::int64_t i) {
  bool matrix = false;
  for (int r = 0; r < a.regions && i >= a.region[r].begin; ++r)
    matrix |= i < a.region[r].begin + a.region[r].size;
  return matrix;
}

// Step state, loaded by thread 0 and broadcast to the block.
template <class T>
struct Update {
  bool frozen;  // the member had a fault before, or its loss or law gradient is not finite now
  std::int64_t step;
  AdamRates<T> rates;
};

template <class T>
__device__ void load_state(const UpdateArguments<T>& a, std::int64_t e, Update<T>& update) {
  const std::int64_t step = a.control.counter[0], count = next(a.members.counts[2 * e]);
  const Sound now = sound(a, e);
  update.frozen = a.members.frozen(e, step, kLoss) | !now.loss | !now.law;
  update.step = step;
  update.rates = adam_rates<T>(a.adam, a.control.row(step)[0] * a.members.lr_scale[e], count);
}

// Counts a block that has read the state of the step. One thread of every block calls it.
__device__ void arrive(const Control& control) {
  asm volatile("red.release.gpu.global.add.u64 [%0], 1;" ::"l"(control.counter + 2) : "memory");
}

// Advances to the next step. One block calls it; it waits until all blocks have arrived. The other
// blocks do not wait. A count that did not start from 0 ends the wait after some seconds: by then
// all blocks have arrived, and the next step starts from 0.
template <class T>
__device__ void advance(const UpdateArguments<T>& a) {
  const std::int64_t step = a.control.counter[0];
  __syncthreads();
  if (threadIdx.x == 0) {
    const std::int64_t blocks = std::int64_t{gridDim.x} * gridDim.y;
    std::int64_t arrived = 0;
    for (int polls = 0; arrived < blocks && polls < kMostPolls; ++polls)
      asm volatile("ld.acquire.gpu.global.u64 %0, [%1];"
                   : "=l"(arrived)
                   : "l"(a.control.counter + 2)
                   : "memory");
    a.control.counter[0] = next(step);
    a.control.counter[2] = 0;
  }
  __syncthreads();
  for (std::int64_t e = threadIdx.x; e < a.control.members; e += kThreads)
    if (!a.members.frozen(e, step, kLoss)) a.members.counts[2 * e] = next(a.members.counts[2 * e]);
}

template <class T>
__device__ void move_law_by_one_thread(const UpdateArguments<T>& a, std::int64_t e) {
  if (threadIdx.x != 0) return;
  const std::int64_t step = a.control.counter[0];
  const bool frozen = a.members.frozen(e, step, kLoss);
  arrive(a.control);
  const Sound now = sound(a, e);
  std::int64_t* fault = a.members.fault + e;
  if (!now.loss) note(fault, step, kLoss);
  if (!now.law) note(fault, step, kLawGradient);
  if (frozen || !now.loss || !now.law) return;
  if (!move_law(a, e, step)) note(fault, step, kLawScalars);
}

// Block 0 of a member updates its friction law, the other blocks its network.
template <class T>
__global__ void __launch_bounds__(kThreads)
    update_kernel(const __grid_constant__ UpdateArguments<T> a) {
  __shared__ Update<T> update;
  const std::int64_t e = blockIdx.y, apart = (gridDim.x - 1) * std::int64_t{kThreads * kEach};
  if (blockIdx.x == 0) {
    wait_for_earlier();
    move_law_by_one_thread(a, e);
    if (e == 0) advance(a);
    return;
  }
  const std::int64_t begin = (blockIdx.x - 1) * std::int64_t{kThreads * kEach} + threadIdx.x;
  const T momentum = static_cast<T>(a.momentum);
  bool good = true, good_gradient = true;
  for (std::int64_t from = begin; from == begin || from - threadIdx.x < a.P; from += apart) {
    T gradient[kEach], first[kEach], second[kEach], param[kEach], direction;
    bool matrix[kEach], other[kEach];
#pragma unroll
    for (int k = 0; k < kEach; ++k) {
      const std::int64_t i = from + k * kThreads;
      matrix[k] = i < a.P && in_matrix(a, i);
      other[k] = i < a.P && !matrix[k];
    }
    const bool once = from == begin;
    if (once) wait_for_earlier();
#pragma unroll
    for (int k = 0; k < kEach; ++k) {
      const std::int64_t at = e * a.P + from + k * kThreads;
      const bool inside = matrix[k] || other[k];
      gradient[k] = inside ? a.gradient[at] : T(0);
      first[k] = inside ? a.first[at] : T(0);
      second[k] = other[k] ? a.second[at] : T(0);
      param[k] = other[k] ? a.params[at] : T(0);
    }
    if (once) {
      if (threadIdx.x == 0) load_state(a, e, update);
      __syncthreads();
      if (threadIdx.x == kThreads - 1) arrive(a.control);
    }
#pragma unroll
    for (int k = 0; k < kEach; ++k) good_gradient &= finite(gradient[k]);
    if (update.frozen) continue;
#pragma unroll
    for (int k = 0; k < kEach; ++k) {
      const std::int64_t at = e * a.P + from + k * kThreads;
      if (matrix[k]) {
        good &= accumulate(momentum, gradient[k], first + k, &direction);
        a.direction[at] = direction;
      } else if (other[k]) {
        good &= adam(update.rates, gradient[k], param + k, first + k, second + k);
        a.params[at] = param[k];
        a.second[at] = second[k];
      }
      if (matrix[k] || other[k]) a.first[at] = first[k];
    }
  }
  if (!good_gradient) note(a.members.fault + e, update.step, kGradient);
  if (!good) note(a.members.fault + e, update.step, kParams);
}

template <class T>
__global__ void __launch_bounds__(kThreads) descend_kernel(const DescendArguments<T> a) {
  wait_for_earlier();
  const std::int64_t e = blockIdx.y, step = a.control.updated();
  if (a.members.frozen(e, step, kParams)) return;
  const T rate = static_cast<T>(a.learning_rate * a.control.row(step)[0] * a.members.lr_scale[e]);
  const std::int64_t count = a.count * a.size;
  bool good = true;
  for (std::int64_t i = first_index(); i < count; i += stride()) {
    const std::int64_t at = e * a.P + a.offset + i / a.size * a.apart + i % a.size;
    good &= descend(rate, a.U[e * count + i], a.params + at);
  }
  if (!good) note(a.members.fault + e, step, kParams);
}

}  // namespace

template <class T>
cudaError_t draw_batch(const BatchArguments<T>& a, cudaStream_t stream) {
  if (a.control.members == 0) return cudaSuccess;
  const dim3 grid = grid_of(a.interior + a.surface + 1, a.control.members);
  return launch_after(draw_kernel<T>, grid, kThreads, 0, stream, a);
}

template <class T>
cudaError_t update(const UpdateArguments<T>& a, cudaStream_t stream) {
  if (a.control.members == 0) return cudaSuccess;
  dim3 grid = grid_of((a.P + kEach - 1) / kEach, a.control.members);
  ++grid.x;  // for the law
  return launch_after(update_kernel<T>, grid, kThreads, 0, stream, a);
}

template <class T>
cudaError_t descend_matrices(const DescendArguments<T>& a, cudaStream_t stream) {
  if (a.control.members == 0 || a.count * a.size == 0) return cudaSuccess;
  return launch_after(descend_kernel<T>, grid_of(a.count * a.size, a.control.members), kThreads, 0,
                      stream, a);
}

#define GRANPINN_INSTANTIATE(T)                                               \
  template cudaError_t draw_batch<T>(const BatchArguments<T>&, cudaStream_t); \
  template cudaError_t update<T>(const UpdateArguments<T>&, cudaStream_t);    \
  template cudaError_t descend_matrices<T>(const DescendArguments<T>&, cudaStream_t);

GRANPINN_INSTANTIATE(float)
GRANPINN_INSTANTIATE(double)

}  // namespace granpinn::cuda
