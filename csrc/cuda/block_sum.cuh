// The sum of one number per thread, in a fixed order.
#pragma once

namespace granpinn::cuda {

// Sum over the threads of a block, returned to thread 0. All threads must call this function.
// Threads: of the block, a power of two.
template <int Threads>
__device__ double block_sum(double value) {
  __shared__ double sums[Threads];
  __syncthreads();  // an earlier sum may still be read
  sums[threadIdx.x] = value;
  for (int half = Threads / 2; half > 0; half /= 2) {
    __syncthreads();
    if (threadIdx.x < half) sums[threadIdx.x] += sums[threadIdx.x + half];
  }
  return sums[0];
}

}  // namespace granpinn::cuda
