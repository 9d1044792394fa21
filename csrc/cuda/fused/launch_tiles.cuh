// From a plan to the instance of the tile kernel that it names; included once per form.
#pragma once

#include "tile_kernel.cuh"
#include "variants.h"

namespace granpinn::cuda::fused {

template <class I, class InteriorTask, class S, class SurfaceTask, int Outputs>
cudaError_t launch(const DeviceLoss<float>& a, const Plan& plan, const Scratch& scratch,
                   Chunk chunk, cudaStream_t stream) {
  const auto kernel = tile_kernel<I, InteriorTask, S, SurfaceTask, Outputs>;
  const int bytes = plan.tile_bytes();
  const cudaError_t error =
      cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes);
  if (error != cudaSuccess) return error;
  kernel<<<dim3(plan.slots, a.net.members), I::threads, bytes, stream>>>(a, plan, scratch, chunk);
  return cudaGetLastError();
}

template <Form form, int C, class InteriorTask, class SurfaceTask, int H, bool tensor_cores,
          bool large>
cudaError_t launch_variant(const DeviceLoss<float>& a, const Plan& plan, const Scratch& scratch,
                           Chunk chunk, cudaStream_t stream) {
  constexpr TileShape t = tile_shape(form, tensor_cores, large);
  constexpr int outputs = form == Form::strong ? 3 : 5;
  const auto run = [&](auto interior, auto surface) {
    using I = decltype(interior);
    static_assert(sizeof(TileMemory<I>) == 4 * tile_floats(t, tensor_cores, H), "layout.h");
    return launch<I, InteriorTask, decltype(surface), SurfaceTask, outputs>(a, plan, scratch, chunk,
                                                                            stream);
  };
  if constexpr (tensor_cores)
    return run(MmaEngine<H, C, t.points, t.split, t.stages>{},
               MmaEngine<H, 1, t.surface_points, t.split, t.stages>{});
  else
    return run(SimtEngine<H, C, t.points, t.split, t.stages>{},
               SimtEngine<H, 1, t.surface_points, t.split, t.stages>{});
}

template <Form form, int C, class InteriorTask, class SurfaceTask>
cudaError_t launch_tiles(const DeviceLoss<float>& a, const Plan& plan, const Scratch& scratch,
                         Chunk chunk, cudaStream_t stream) {
  const auto by_width = [&](auto tensor_cores, auto large) {
    constexpr bool tc = decltype(tensor_cores)::value, big = decltype(large)::value;
    if (plan.H == 128)
      return launch_variant<form, C, InteriorTask, SurfaceTask, 128, tc, big>(a, plan, scratch,
                                                                              chunk, stream);
    return launch_variant<form, C, InteriorTask, SurfaceTask, 256, tc, big>(a, plan, scratch, chunk,
                                                                            stream);
  };
  using Yes = std::true_type;
  using No = std::false_type;
  if (plan.tensor_cores) return plan.large ? by_width(Yes{}, Yes{}) : by_width(Yes{}, No{});
  return plan.large ? by_width(No{}, Yes{}) : by_width(No{}, No{});
}

}  // namespace granpinn::cuda::fused
