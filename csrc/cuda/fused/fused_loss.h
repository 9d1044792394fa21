// The fast path of residual_loss: float32, hidden layers of at most 256 neurons.
#pragma once

#include "layout.h"

namespace granpinn::cuda::fused {

bool supports(const DeviceLoss<float>& a);
Plan make_plan(const DeviceLoss<float>& a, bool tensor_cores, int multiprocessors);
std::size_t scratch_size(const DeviceLoss<float>& a, const Plan& plan);

// `memory` is as large as scratch_size says and aligned to 256 bytes.
cudaError_t loss(const DeviceLoss<float>& a, const Plan& plan, void* memory, cudaStream_t stream);

}  // namespace granpinn::cuda::fused
