#include "launch_tiles.cuh"

namespace granpinn::cuda::fused {

cudaError_t launch_strong_mu_of_i_tiles(const DeviceLoss<float>& a, const LaunchPlan& plan,
                                        const Scratch& scratch, Chunk chunk, cudaStream_t stream) {
  return launch_tiles<Form::strong, 7, Interior<StrongForm<PressureMap::linear>, MuOfI>,
                      Surface<PressureMap::linear>>(a, plan, scratch, chunk, stream);
}

}  // namespace granpinn::cuda::fused
