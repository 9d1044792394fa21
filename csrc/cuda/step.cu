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
__device__ bool in_matrix(const UpdateArguments<T>& a, std::int64_t i) {
  bool matrix = false;
  for (int r = 0; r < a.regions && i >= a.region[r].begin; ++r)
    matrix |= i < a.region[r].begin + a.region[r].size;
  return matrix;
}

// In the blocks of an update, one more warp than have values, for what all of them need to know.
constexpr int kUpdateThreads = kThreads + 32;

// Values that a thread has on their way at once: fewer where there are so few in all that every
// block runs from the start, since then the time is that of one thread.
constexpr int kEach = 4, kEachOfFew = 2;
constexpr std::int64_t kFew = std::int64_t(1) << 17;

// What its first thread finds out while the others wait for their values.
template <class T>
struct Update {
  bool frozen;  // who had a fault before this step, or has one that each block finds by itself
  std::int64_t step;
  T weight;
  AdamRates<T> rates;
};

template <class T>
__device__ void find_out(const UpdateArguments<T>& a, std::int64_t e, Update<T>& update) {
  const std::int64_t step = a.control.counter[0], count = a.members.counts[2 * e] + 1;
  const bool frozen = a.members.frozen(e, step, kLoss);
  const Sound now = sound(a, e);
  const double* row = a.control.row(step);
  const double factor = row[0], average = row[1], slower = a.members.slower[e];
  asm volatile("" ::: "memory");  // all of these are on their way now, and stay so in the loop
  const AdamPowers powers = adam_powers(a.adam, count);
  update.frozen = frozen | !now.loss | !now.law;
  update.step = step;
  update.weight = static_cast<T>(average);
  update.rates = adam_rates<T>(a.adam, factor * slower, powers);
}

// By one thread of every block: the block has read the state of the step.
__device__ void arrive(const Control& control) {
  asm volatile("red.release.gpu.global.add.u64 [%0], 1;" ::"l"(control.counter + 2) : "memory");
}

// By the last warp of one block, when all blocks have arrived, and they need not wait for it: on to
// the next step.
template <class T>
__device__ void advance(const UpdateArguments<T>& a, std::int64_t step) {
  if (threadIdx.x == kThreads) {
    const std::int64_t blocks = std::int64_t{gridDim.x} * gridDim.y;
    std::int64_t arrived = 0;
    while (arrived < blocks)
      asm volatile("ld.acquire.gpu.global.u64 %0, [%1];"
                   : "=l"(arrived)
                   : "l"(a.control.counter + 2)
                   : "memory");
    a.control.counter[0] = step + 1;
    a.control.counter[2] = 0;
  }
  __syncwarp();
  for (std::int64_t e = threadIdx.x % 32; e < a.control.members; e += 32)
    if (!a.members.frozen(e, step, kLoss)) ++a.members.counts[2 * e];
}

// By a block: its first thread moves the friction law, its last warp sees to the next step.
template <class T>
__device__ void move_law_by_one_thread(const UpdateArguments<T>& a, std::int64_t e) {
  if (threadIdx.x >= 32 && threadIdx.x < kThreads) return;
  wait_for_earlier();
  const std::int64_t step = a.control.counter[0];
  const LawState<T> law = law_state(a, e, step);
  const Sound now = sound(a, e);
  const bool frozen = __syncthreads_or(a.members.frozen(e, step, kLoss));
  if (threadIdx.x == kThreads) arrive(a.control);
  if (e == 0 && threadIdx.x >= kThreads) advance(a, step);
  if (threadIdx.x != 0) return;
  std::int64_t* fault = a.members.fault + e;
  if (!now.loss) note(fault, step, kLoss);
  if (!now.law) note(fault, step, kLawGradient);
  if (frozen || !now.loss || !now.law) return;
  if (!move_law(a, e, law)) note(fault, step, kLawScalars);
}

// The first block of a member moves its friction law, the others have its parameters.
template <class T, int Each>
__global__ void __launch_bounds__(kUpdateThreads)
    update_kernel(const __grid_constant__ UpdateArguments<T> a) {
  __shared__ Update<T> update;
  const std::int64_t e = blockIdx.y, apart = (gridDim.x - 1) * std::int64_t{kThreads * Each};
  if (blockIdx.x == 0) {
    move_law_by_one_thread(a, e);
    return;
  }
  if (threadIdx.x >= kThreads) {
    wait_for_earlier();
    if (threadIdx.x == kThreads) find_out(a, e, update);
    __syncthreads();
    if (threadIdx.x == kThreads) arrive(a.control);
    return;
  }
  const std::int64_t begin = (blockIdx.x - 1) * std::int64_t{kThreads * Each} + threadIdx.x;
  const T momentum = static_cast<T>(a.momentum);
  bool good = true, good_gradient = true;
  for (std::int64_t from = begin; from == begin || from - threadIdx.x < a.P; from += apart) {
    T gradient[Each], first[Each], second[Each], param[Each], average[Each], direction;
    bool matrix[Each], other[Each];
#pragma unroll
    for (int k = 0; k < Each; ++k) {
      const std::int64_t i = from + k * kThreads;
      matrix[k] = i < a.P && in_matrix(a, i);
      other[k] = i < a.P && !matrix[k];
    }
    const bool once = from == begin;
    if (once) wait_for_earlier();
#pragma unroll
    for (int k = 0; k < Each; ++k) {
      const std::int64_t at = e * a.P + from + k * kThreads;
      const bool inside = matrix[k] || other[k];
      gradient[k] = inside ? a.gradient[at] : T(0);
      first[k] = inside ? a.first[at] : T(0);
      second[k] = other[k] ? a.second[at] : T(0);
      param[k] = other[k] ? a.params[at] : T(0);
    }
    if (once) __syncthreads();
#pragma unroll
    for (int k = 0; k < Each; ++k) good_gradient &= finite(gradient[k]);
    if (update.frozen) continue;
    const T weight = update.weight;
    if (weight > T(0))
#pragma unroll
      for (int k = 0; k < Each; ++k)
        average[k] = other[k] ? a.average_params[e * a.P + from + k * kThreads] : T(0);
#pragma unroll
    for (int k = 0; k < Each; ++k) {
      const std::int64_t at = e * a.P + from + k * kThreads;
      if (matrix[k]) {
        good &= accumulate(momentum, gradient[k], first + k, &direction);
        a.direction[at] = direction;
      } else if (other[k]) {
        good &= adam(update.rates, gradient[k], param + k, first + k, second + k);
        a.params[at] = param[k];
        a.second[at] = second[k];
        if (weight > T(0)) a.average_params[at] = interpolate(average[k], param[k], weight);
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
  const double* row = a.control.row(step);
  const T rate = static_cast<T>(a.learning_rate * row[0] * a.members.slower[e]);
  const T weight = static_cast<T>(row[1]);
  const std::int64_t count = a.count * a.size;
  bool good = true;
  for (std::int64_t i = first_index(); i < count; i += stride()) {
    const std::int64_t at = e * a.P + a.offset + i / a.size * a.apart + i % a.size;
    good &= descend(rate, a.U[e * count + i], a.params + at);
    if (weight > T(0))
      a.average_params[at] = interpolate(a.average_params[at], a.params[at], weight);
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

template <class T, int Each>
cudaError_t launch_update(const UpdateArguments<T>& a, cudaStream_t stream) {
  dim3 grid = grid_of((a.P + Each - 1) / Each, a.control.members);
  ++grid.x;  // for the law
  return launch_after(update_kernel<T, Each>, grid, kUpdateThreads, 0, stream, a);
}

template <class T>
cudaError_t update(const UpdateArguments<T>& a, cudaStream_t stream) {
  if (a.control.members == 0) return cudaSuccess;
  return a.control.members * a.P <= kFew ? launch_update<T, kEachOfFew>(a, stream)
                                         : launch_update<T, kEach>(a, stream);
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
