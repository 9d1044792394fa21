// Programmatic dependent launch: a kernel may start while the kernel before it in the stream still
// runs, so that its launch costs no time. It then waits until the earlier kernel is complete.
//
//   kernel 1   | blocks ...      let_next_start | ... end |
//   kernel 2                         | start up | wait_for_earlier | work ...
//
// On a GPU that cannot do this (compute capability below 9.0), or with code compiled for such a
// GPU, a kernel is launched like any other.
#pragma once

#include <cuda_runtime.h>

namespace granpinn::cuda {

// Allows the next kernel to start.
__device__ inline void let_next_start() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.launch_dependents;" ::: "memory");
#endif
}

// Waits until all earlier kernels have ended, then allows the next kernel to start. To be called
// before global memory is read or written. A kernel that shares no memory with the kernel before
// may call it at its end instead, for the sake of later kernels. Its work then starts as soon as
// all blocks of the kernel before have called let_next_start.
__device__ inline void wait_for_earlier() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.wait;" ::: "memory");
#endif
  let_next_start();
}

// Launches `kernel`, which must call wait_for_earlier.
template <class... Parameters, class... Arguments>
cudaError_t launch_after(void (*kernel)(Parameters...), dim3 grid, dim3 block, std::size_t bytes,
                         cudaStream_t stream, const Arguments&... arguments) {
  cudaFuncAttributes code{};
  if (const cudaError_t error = cudaFuncGetAttributes(&code, kernel)) return error;
  cudaLaunchAttribute early{};
  early.id = cudaLaunchAttributeProgrammaticStreamSerialization;
  early.val.programmaticStreamSerializationAllowed = 1;
  cudaLaunchConfig_t launch{};
  launch.gridDim = grid;
  launch.blockDim = block;
  launch.dynamicSmemBytes = bytes;
  launch.stream = stream;
  launch.attrs = &early;
  launch.numAttrs = code.ptxVersion >= 90 ? 1 : 0;
  return cudaLaunchKernelEx(&launch, kernel, arguments...);
}

}  // namespace granpinn::cuda
