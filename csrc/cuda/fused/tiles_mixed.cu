#include "launch_tiles.cuh"

namespace granpinn::cuda::fused {

cudaError_t launch_mixed_mu_of_i_tiles(const DeviceLoss<float>& a, const LaunchPlan& plan,
                                       const Scratch& scratch, Chunk chunk, cudaStream_t stream) {
  return launch_tiles<Form::mixed, 4, Interior<MixedForm, MuOfI>, Surface<PressureMap::softplus>>(
      a, plan, scratch, chunk, stream);
}

}  // namespace granpinn::cuda::fused
