// The instances of the tile kernel. mu(I) has one of its own, which needs the fewest registers; any
// other law shares one that chooses the law at run time.
#pragma once

#include "layout.h"

namespace granpinn::cuda::fused {

cudaError_t launch_data_tiles(const DeviceLoss<float>& a, const LaunchPlan& plan,
                              const Scratch& scratch, Chunk chunk, cudaStream_t stream);
cudaError_t launch_mixed_mu_of_i_tiles(const DeviceLoss<float>& a, const LaunchPlan& plan,
                                       const Scratch& scratch, Chunk chunk, cudaStream_t stream);
cudaError_t launch_mixed_any_law_tiles(const DeviceLoss<float>& a, const LaunchPlan& plan,
                                       const Scratch& scratch, Chunk chunk, cudaStream_t stream);
cudaError_t launch_strong_mu_of_i_tiles(const DeviceLoss<float>& a, const LaunchPlan& plan,
                                        const Scratch& scratch, Chunk chunk, cudaStream_t stream);
cudaError_t launch_strong_any_law_tiles(const DeviceLoss<float>& a, const LaunchPlan& plan,
                                        const Scratch& scratch, Chunk chunk, cudaStream_t stream);

}  // namespace granpinn::cuda::fused
