// The kernel that takes all tiles of a chunk through the network and back.
#pragma once

#include "../launch_after.cuh"
#include "tasks.cuh"

namespace granpinn::cuda::fused {

// A tile's points into shared memory.
template <class E, class Task, class Memory>
__device__ void load_points(const DeviceLoss<float>& a, std::int64_t e, std::int64_t at,
                            Memory& m) {
  for (int i = threadIdx.x; i < 3 * E::PT; i += E::threads)
    m.xi[i % 3 * E::R + i / 3] = Task::xi(a, e, at, i / 3, i % 3);
  for (int i = threadIdx.x; i < 4 * E::PT; i += E::threads)
    m.observed[i] = Task::observed(a, e, at, i / 4, i % 4);
}

// Number i of the first layer's weights and biases [4][H].
template <int H>
__device__ float first_layer_parameter(const DeviceLoss<float>& a, std::int64_t e, int i) {
  const int width = static_cast<int>(a.net.out(0)), n = i % H, row = i / H;
  const float* params = a.net.params + e * a.net.count;
  return n < width ? params[row < 3 ? 3 * n + row : 3 * width + n] : 0;
}

// A tile's points, the member's constants and the first layer's weights into shared memory. All
// loads are issued before any store: in turn they would take a tenth of a small tile's time.
template <class E, class Task, class Memory>
__device__ void load_all(const DeviceLoss<float>& a, std::int64_t e, std::int64_t at, Memory& m) {
  constexpr int threads = E::threads, each = 4 * E::H / threads;
  constexpr int axes = (3 * E::PT + threads - 1) / threads;
  constexpr int seen = (4 * E::PT + threads - 1) / threads;
  float weight[each], xi[axes] = {}, observed[seen] = {}, constant = 0;
  const int thread = threadIdx.x, c = threads - 1 - thread;
#pragma unroll
  for (int k = 0; k < each; ++k)
    weight[k] = first_layer_parameter<E::H>(a, e, thread + k * threads);
  if (c < kConstants)
    constant = constant_of(a, e, c);
  else if (c < kConstants + 3)
    constant = a.net.input.scale_of(e, c - kConstants);
#pragma unroll
  for (int k = 0; k < axes; ++k) {
    const int i = thread + k * threads;
    if (i < 3 * E::PT) xi[k] = Task::xi(a, e, at, i / 3, i % 3);
  }
#pragma unroll
  for (int k = 0; k < seen; ++k) {
    const int i = thread + k * threads;
    if (i < 4 * E::PT) observed[k] = Task::observed(a, e, at, i / 4, i % 4);
  }
  __syncthreads();  // all threads are done with the tile before
#pragma unroll
  for (int k = 0; k < each; ++k) m.panel[thread + k * threads] = weight[k];
  if (c < kConstants)
    m.constants[c] = constant;
  else if (c < kConstants + 3)
    m.scale[c - kConstants] = constant;
#pragma unroll
  for (int k = 0; k < axes; ++k) {
    const int i = thread + k * threads;
    if (i < 3 * E::PT) m.xi[i % 3 * E::R + i / 3] = xi[k];
  }
#pragma unroll
  for (int k = 0; k < seen; ++k) {
    const int i = thread + k * threads;
    if (i < 4 * E::PT) m.observed[i] = observed[k];
  }
}

// One tile: E is its engine, Task compares its outputs with the data. With few values, the block's
// `first` tile loads inputs that the kernel before does not write, waits for that kernel and starts
// the stream of weights. Otherwise the caller has done this and filled `constants`.
template <class E, class Task, int Outputs, class Memory, class Start>
__device__ void do_tile(const DeviceLoss<float>& a, std::int64_t e, const TaskConstants& constants,
                        const TileNetwork& net, Memory& m, typename E::Stream& weights, Start start,
                        std::int64_t at, std::int64_t first_row, bool first, double& sum) {
  if constexpr (kFewValues<E>) {
    load_all<E, Task>(a, e, at, m);
    if (first) {
      wait_for_earlier();
      weights = start();
    }
  } else {
    __syncthreads();
    load_points<E, Task>(a, e, at, m);
  }
  __syncthreads();
  Tile<E, Outputs, Memory> tile(net, m, weights, first_row);
  tile.forward();
  if constexpr (kFewValues<E>)
    Task::template evaluate<E>(a, e, at,
                               constants_from(m.constants, m.constants + kTerms, kMaxLawParameters,
                                              m.constants + kSums, a.law_of(e)),
                               m);
  else
    Task::template evaluate<E>(a, e, at, constants, m);
  __syncthreads();
  if (threadIdx.x < kSums)
    for (int p = 0; p < E::PT; ++p) sum += m.terms()[threadIdx.x * E::R + p];
  tile.backward();
}

// The panels of a member.
template <class E>
__device__ void* panels_of(void* all, std::int64_t e, const LaunchPlan& plan) {
  return static_cast<typename E::Element*>(all) + e * (plan.hidden - 1) * plan.panel();
}

// A block is one slot of one member, blockIdx = (slot, member), and takes every slots-th tile.
// I and S are the engines of interior and surface tiles: same width, and S has at most I's rows.
template <class I, class InteriorTask, class S, class SurfaceTask, int Outputs, int Blocks>
__global__ void __launch_bounds__(I::threads, Blocks)
    tile_kernel(const __grid_constant__ DeviceLoss<float> a,
                const __grid_constant__ LaunchPlan plan, const Scratch scratch, const Chunk chunk) {
  static_assert(I::R >= S::R && I::threads == S::threads, "tiles share their memory");
  constexpr bool few = kFewValues<I>;
  static_assert(few == kFewValues<S>, "they start alike");
  extern __shared__ __align__(16) unsigned char memory[];
  auto& m = *reinterpret_cast<TileMemory<I>*>(memory);
  float* gradient = reinterpret_cast<float*>(memory + sizeof(TileMemory<I>));
  for (int i = threadIdx.x; i < plan.narrow(); i += I::threads) gradient[i] = 0;
  if (threadIdx.x < 2 * kRow) m.peaks[threadIdx.x / kRow][threadIdx.x % kRow] = 0;
  // With few values, wait here only for a batch that is drawn beside the packing of the weights.
  // Otherwise the pack kernel waited for the writer of the parameters before this kernel started.
  if (!few || a.drawn) wait_for_earlier();

  const std::int64_t e = blockIdx.y, block = e * plan.slots + blockIdx.x;
  const int L = plan.hidden, narrow = plan.narrow();
  TaskConstants constants;
  if constexpr (!few)
    constants = constants_from(a.term_weights.member(e), a.theta.member(e), a.parameters,
                               a.physics.member(e), a.law_of(e));
  const TileNetwork net{plan,
                        scratch.narrow + e * narrow,
                        scratch.stash + block * plan.stash(),
                        panels_of<I>(scratch.activations, e, plan),
                        panels_of<I>(scratch.adjoints, e, plan),
                        scratch.activation_scales + e * (L - 1) * plan.scales(),
                        scratch.adjoint_scales + e * (L - 1) * plan.scales(),
                        gradient};
  const auto start = [&] {
    return typename I::Stream(scratch.packed + e * plan.packed(), plan.stream(),
                              m.ring + threadIdx.x / 32 * I::Stream::floats);
  };
  typename I::Stream weights;
  if constexpr (!few) {
    weights = start();
    if (threadIdx.x < 3) m.scale[threadIdx.x] = a.net.input.scale_of(e, threadIdx.x);
  }

  double sum = 0;
  const int first = blockIdx.x;
  for (int i = first; i < chunk.count; i += plan.slots) {
    const std::int64_t tile = chunk.begin + i, first_row = std::int64_t(i) * plan.tile.panel_rows;
    if (tile < plan.interior_tiles)
      do_tile<I, InteriorTask, Outputs>(a, e, constants, net, m, weights, start, tile * I::PT,
                                        first_row, i == first, sum);
    else
      do_tile<S, SurfaceTask, Outputs>(a, e, constants, net, m, weights, start,
                                       (tile - plan.interior_tiles) * S::PT, first_row, i == first,
                                       sum);
  }
  if constexpr (few) wait_for_earlier();  // for blocks without a tile
  if (plan.products()) weights.drain();
  __syncthreads();

  float* to = scratch.narrow_gradients + block * narrow;
  const bool adds = chunk.begin > 0;
  for (int i = threadIdx.x; i < narrow; i += I::threads) to[i] = (adds ? to[i] : 0) + gradient[i];
  if (threadIdx.x < kSums) {
    double& total = scratch.sums[block * kSums + threadIdx.x];
    total = (adds ? total : 0) + sum;
  }
}

}  // namespace granpinn::cuda::fused
