// Kernels that may be started while the one before them in the stream still runs, so that their
// launch costs no time: each first waits for that one to be complete.
//
// Where a GPU cannot do that (compute capability below 9.0), or runs code for such a GPU, a kernel
// is launched like any other.
#pragma once

#include <cuda_runtime.h>

namespace granpinn::cuda {

// The next kernel may be started.
__device__ inline void let_next_start() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.launch_dependents;" ::: "memory");
#endif
}

// To be called before global memory is touched; all earlier kernels have ended after it, and the
// next one may be started. A kernel that does not share memory with the one before may call it at
// its end, for those that come later; it then starts when that one's blocks have all come to this.
__device__ inline void wait_for_earlier() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.wait;" ::: "memory");
#endif
  let_next_start();
}

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
