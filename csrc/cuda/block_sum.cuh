// The sum of one number per thread, in a fixed order.
#pragma once

namespace granpinn::cuda {

// Every thread of the block must call it; thread 0 gets the sum. Threads: a power of two.
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
