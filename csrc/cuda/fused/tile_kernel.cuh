// The kernel that takes all tiles of a chunk through the network and back.
#pragma once

#include "../launch_after.cuh"
#include "tasks.cuh"

namespace granpinn::cuda::fused {

// One tile: E is its engine, Task what its outputs are compared with.
template <class E, class Task, int Outputs, class Memory>
__device__ void do_tile(const DeviceLoss<float>& a, std::int64_t e, const TaskConstants& c,
                        const TileNetwork& net, Memory& m, typename E::Stream& weights,
                        std::int64_t at, std::int64_t first_row, double& sum) {
  __syncthreads();
  Task::template load<E>(a, e, at, m);
  __syncthreads();
  Tile<E, Outputs, Memory> tile(net, m, weights, first_row);
  tile.forward();
  Task::template evaluate<E>(a, c, m);
  __syncthreads();
  if (threadIdx.x < kSums)
    for (int p = 0; p < E::PT; ++p) sum += m.terms()[threadIdx.x * E::R + p];
  tile.backward();
}

// The panels of a member.
template <class E>
__device__ void* panels_of(void* all, std::int64_t e, const Plan& plan) {
  return static_cast<typename E::Element*>(all) + e * (plan.hidden - 1) * plan.panel();
}

// A block is one slot of one member, blockIdx = (slot, member), and takes every slots-th tile.
// I and S are the engines of interior and surface tiles: same width, for the surface no more rows.
template <class I, class InteriorTask, class S, class SurfaceTask, int Outputs, int Blocks>
__global__ void __launch_bounds__(I::threads, Blocks)
    tile_kernel(const __grid_constant__ DeviceLoss<float> a, const __grid_constant__ Plan plan,
                const Scratch scratch, const Chunk chunk) {
  static_assert(I::R >= S::R && I::threads == S::threads, "tiles share their memory");
  extern __shared__ __align__(16) unsigned char memory[];
  auto& m = *reinterpret_cast<TileMemory<I>*>(memory);
  float* gradient = reinterpret_cast<float*>(memory + sizeof(TileMemory<I>));
  for (int i = threadIdx.x; i < plan.narrow(); i += I::threads) gradient[i] = 0;
  if (threadIdx.x < 2 * kRow) m.peaks[threadIdx.x / kRow][threadIdx.x % kRow] = 0;
  wait_for_earlier();

  const std::int64_t e = blockIdx.y, block = e * plan.slots + blockIdx.x;
  const int L = plan.hidden, narrow = plan.narrow();
  const TaskConstants constants = constants_of(a, e);
  const TileNetwork net{plan,
                        scratch.narrow + e * narrow,
                        scratch.stash + block * plan.stash(),
                        panels_of<I>(scratch.activations, e, plan),
                        panels_of<I>(scratch.adjoints, e, plan),
                        scratch.activation_scales + e * (L - 1) * plan.scales(),
                        scratch.adjoint_scales + e * (L - 1) * plan.scales(),
                        gradient};
  typename I::Stream weights(scratch.packed + e * plan.packed(), plan.stream(),
                             m.ring + threadIdx.x / 32 * I::Stream::floats);
  if (threadIdx.x < 3) m.scale[threadIdx.x] = a.net.input.scale_of(e, threadIdx.x);

  double sum = 0;
  for (int i = blockIdx.x; i < chunk.count; i += plan.slots) {
    const std::int64_t tile = chunk.begin + i, first_row = std::int64_t(i) * plan.tile.panel_rows;
    if (tile < plan.interior_tiles)
      do_tile<I, InteriorTask, Outputs>(a, e, constants, net, m, weights, tile * I::PT, first_row,
                                        sum);
    else
      do_tile<S, SurfaceTask, Outputs>(a, e, constants, net, m, weights,
                                       (tile - plan.interior_tiles) * S::PT, first_row, sum);
  }
  if (plan.products()) weights.drain();
  __syncthreads();

  float* to = scratch.narrow_gradients + block * narrow;
  const bool first = chunk.begin == 0;
  for (int i = threadIdx.x; i < narrow; i += I::threads) to[i] = (first ? 0 : to[i]) + gradient[i];
  if (threadIdx.x < kSums) {
    double& total = scratch.sums[block * kSums + threadIdx.x];
    total = (first ? 0 : total) + sum;
  }
}

}  // namespace granpinn::cuda::fused
