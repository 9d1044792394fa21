// From a plan to the instance of the tile kernel that it names; included once per form.
#pragma once

#include "tile_kernel.cuh"
#include "variants.h"

namespace granpinn::cuda::fused {

template <class I, class InteriorTask, class S, class SurfaceTask>
cudaError_t launch(const DeviceLoss<float>& a, const Plan& plan, const Scratch& scratch,
                   Chunk chunk, cudaStream_t stream) {
  const auto kernel = tile_kernel<I, InteriorTask, S, SurfaceTask>;
  const int bytes = sizeof(TileMemory<I>) +
                    (plan.narrow() + (plan.shared_stash ? plan.stash() : 0)) * sizeof(float);
  const cudaError_t error =
      cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes);
  if (error != cudaSuccess) return error;
  kernel<<<dim3(plan.slots, a.net.members), I::H, bytes, stream>>>(a, plan, scratch, chunk);
  return cudaGetLastError();
}

template <Form form, int C, class InteriorTask, class SurfaceTask, int H, bool tensor_cores,
          bool large>
cudaError_t launch_variant(const DeviceLoss<float>& a, const Plan& plan, const Scratch& scratch,
                           Chunk chunk, cudaStream_t stream) {
  constexpr TileShape shape = tile_shape(form, tensor_cores, large);
  if constexpr (tensor_cores)
    return launch<MmaEngine<H, C, shape.points>, InteriorTask,
                  MmaEngine<H, 1, shape.surface_points>, SurfaceTask>(a, plan, scratch, chunk,
                                                                      stream);
  else
    return launch<SimtEngine<H, C, shape.points / 4>, InteriorTask,
                  SimtEngine<H, 1, shape.surface_points / 4>, SurfaceTask>(a, plan, scratch, chunk,
                                                                           stream);
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
