#include "launch_tiles.cuh"

namespace granpinn::cuda::fused {

cudaError_t launch_data_tiles(const DeviceLoss<float>& a, const LaunchPlan& plan,
                              const Scratch& scratch, Chunk chunk, cudaStream_t stream) {
  return launch_tiles<Form::data, 1, Values, SurfaceOfForm>(a, plan, scratch, chunk, stream);
}

}  // namespace granpinn::cuda::fused
