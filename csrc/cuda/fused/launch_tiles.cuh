// Launches the instance of the tile kernel that a launch plan selects: by width, tensor cores and
// size of the tiles. Included once per form (tiles_*.cu).
#pragma once

#include "../launch_after.cuh"
#include "tile_kernel.cuh"
#include "variants.h"

namespace granpinn::cuda::fused {

template <class I, class InteriorTask, class S, class SurfaceTask, int Outputs, int Blocks>
cudaError_t launch(const DeviceLoss<float>& a, const LaunchPlan& plan, const Scratch& scratch,
                   Chunk chunk, cudaStream_t stream) {
  const auto kernel = tile_kernel<I, InteriorTask, S, SurfaceTask, Outputs, Blocks>;
  const int bytes = plan.tile_bytes();
  const cudaError_t error =
      cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes);
  if (error != cudaSuccess) return error;
  return launch_after(kernel, dim3(plan.slots, a.net.members), I::threads, bytes, stream, a, plan,
                      scratch, chunk);
}

template <Form form, int C, class InteriorTask, class SurfaceTask, int H, bool tensor_cores,
          Size size>
cudaError_t launch_variant(const DeviceLoss<float>& a, const LaunchPlan& plan,
                           const Scratch& scratch, Chunk chunk, cudaStream_t stream) {
  constexpr TileShape t = tile_shape(form, tensor_cores, size, H);
  constexpr int outputs = form == Form::strong ? 3 : 5;
  [[maybe_unused]] constexpr bool fine = fine_weights(form, tensor_cores);
  [[maybe_unused]] constexpr bool more_rows = compensated(tensor_cores);
  [[maybe_unused]] constexpr bool surface_rows = more_rows && form == Form::data;
  const auto run = [&](auto interior, auto surface) {
    using I = decltype(interior);
    static_assert(sizeof(TileMemory<I>) == 4 * tile_floats(t, H), "layout.h");
    return launch<I, InteriorTask, decltype(surface), SurfaceTask, outputs, t.blocks>(
        a, plan, scratch, chunk, stream);
  };
  if constexpr (tensor_cores)
    return run(MmaEngine<H, C, t.points, t.split, t.stages, fine, more_rows, t.kept>{},
               MmaEngine<H, 1, t.surface_points, t.split, t.stages, fine, surface_rows, t.kept>{});
  else
    return run(SimtEngine<H, C, t.points, t.parts, t.stage, t.stages>{},
               SimtEngine<H, 1, t.surface_points, t.parts, t.stage, t.stages>{});
}

template <Form form, int C, class InteriorTask, class SurfaceTask>
cudaError_t launch_tiles(const DeviceLoss<float>& a, const LaunchPlan& plan, const Scratch& scratch,
                         Chunk chunk, cudaStream_t stream) {
  const auto by_width = [&](auto tensor_cores, auto size) {
    constexpr bool tc = decltype(tensor_cores)::value;
    constexpr Size s = decltype(size)::value;
    if (plan.H == 128)
      return launch_variant<form, C, InteriorTask, SurfaceTask, 128, tc, s>(a, plan, scratch, chunk,
                                                                            stream);
    return launch_variant<form, C, InteriorTask, SurfaceTask, 256, tc, s>(a, plan, scratch, chunk,
                                                                          stream);
  };
  const auto by_size = [&](auto tensor_cores) {
    if (plan.size == Size::large)
      return by_width(tensor_cores, std::integral_constant<Size, Size::large>{});
    if (plan.size == Size::medium)
      return by_width(tensor_cores, std::integral_constant<Size, Size::medium>{});
    return by_width(tensor_cores, std::integral_constant<Size, Size::small>{});
  };
  return plan.tensor_cores ? by_size(std::true_type{}) : by_size(std::false_type{});
}

}  // namespace granpinn::cuda::fused
