#include "launch_tiles.cuh"

namespace granpinn::cuda::fused {

// The pressure of the surface is that of the network's form, which its outputs tell.
cudaError_t launch_data_tiles(const DeviceLoss<float>& a, const Plan& plan, const Scratch& scratch,
                              Chunk chunk, cudaStream_t stream) {
  if (plan.outputs == MixedForm::fields)
    return launch_tiles<Form::data, 1, Values, PressureMap::softplus>(a, plan, scratch, chunk,
                                                                      stream);
  return launch_tiles<Form::data, 1, Values, PressureMap::linear>(a, plan, scratch, chunk, stream);
}

}  // namespace granpinn::cuda::fused
