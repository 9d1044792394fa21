// Launchers of the kernels of an optimization step: one launch each, without waiting for the GPU.
// All pointers in the structs are device pointers.
#pragma once

#include <cuda_runtime_api.h>

#include "batch.h"

namespace granpinn::cuda {

template <class T>
cudaError_t draw_batch(const BatchArguments<T>& a, cudaStream_t stream);

template <class T>
cudaError_t update(const UpdateArguments<T>& a, cudaStream_t stream);

template <class T>
cudaError_t descend_matrices(const DescendArguments<T>& a, cudaStream_t stream);

}  // namespace granpinn::cuda
