// Launches kernels on a stream and keeps the first error. After an error it launches nothing more.
#pragma once

#include <cstdint>

namespace granpinn::cuda {

class Launcher {
 public:
  explicit Launcher(cudaStream_t stream) : stream_(stream) {}

  template <class... Parameters, class... Arguments>
  void operator()(void (*kernel)(Parameters...), dim3 grid, dim3 block, Arguments... arguments) {
    if (status_ != cudaSuccess) return;
    kernel<<<grid, block, 0, stream_>>>(arguments...);
    status_ = cudaGetLastError();
  }

  void zero(void* data, std::size_t bytes) {
    if (status_ == cudaSuccess) status_ = cudaMemsetAsync(data, 0, bytes, stream_);
  }

  cudaError_t status() const { return status_; }

 private:
  cudaStream_t stream_;
  cudaError_t status_ = cudaSuccess;
};

// Number of blocks of `size` elements that cover `count` elements.
inline unsigned blocks_of(std::int64_t count, std::int64_t size) {
  return static_cast<unsigned>((count + size - 1) / size);
}

}  // namespace granpinn::cuda
