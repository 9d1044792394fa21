// Launchers of the tile kernel, one for each form of the loss.
#pragma once

#include "layout.h"

namespace granpinn::cuda::fused {

cudaError_t launch_data_tiles(const DeviceLoss<float>& a, const LaunchPlan& plan,
                              const Scratch& scratch, Chunk chunk, cudaStream_t stream);
cudaError_t launch_mixed_tiles(const DeviceLoss<float>& a, const LaunchPlan& plan,
                               const Scratch& scratch, Chunk chunk, cudaStream_t stream);
cudaError_t launch_strong_tiles(const DeviceLoss<float>& a, const LaunchPlan& plan,
                                const Scratch& scratch, Chunk chunk, cudaStream_t stream);

}  // namespace granpinn::cuda::fused
