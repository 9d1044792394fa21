// The fast path of residual_loss: float32, hidden layers of at most 256 neurons.
#pragma once

#include "layout.h"

namespace granpinn::cuda::fused {

struct DeviceLimits {
  int multiprocessors;
  int shared_per_block, shared_per_multiprocessor;  // bytes of shared memory
};

// Cuts the problem into blocks, tiles and chunks. Returns false if this path cannot compute it: too
// many neurons, layers, members or parameters, or a GPU with too little shared memory.
bool make_launch_plan(const DeviceLoss<float>& a, bool tensor_cores, const DeviceLimits& device,
                      LaunchPlan& plan);
// Bytes of scratch memory that `loss` needs.
std::size_t scratch_size(const DeviceLoss<float>& a, const LaunchPlan& plan);

// memory: scratch_size bytes, aligned to 256 bytes.
cudaError_t loss(const DeviceLoss<float>& a, const LaunchPlan& plan, void* memory,
                 cudaStream_t stream);

}  // namespace granpinn::cuda::fused
