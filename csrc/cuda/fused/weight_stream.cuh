// A warp's stream of hidden weights: from L2 through a ring of stages in shared memory.
//
// The packed weights of a tile lie in the order of their use, so the stream runs on across layers
// and tiles: while a layer's activations are computed, the next layer's weights arrive.
#pragma once

#include <cuda_pipeline_primitives.h>

#include "layout.h"

namespace granpinn::cuda::fused {

__device__ inline float add_lanes(float a, int apart) {
  return a + __shfl_xor_sync(~0u, a, apart);
}

template <int H, int Stages>
class WeightStream {
 public:
  static constexpr int kFloats = Stages * kStage;  // of shared memory, per warp

  __device__ WeightStream(const float* packed, int products, float* ring)
      : packed_(packed), total_(products * kSteps), ring_(ring) {
    if (total_ == 0) return;
    for (int i = 0; i < Stages - 1; ++i) fetch(i);
  }

  // The next stage, complete for all lanes; valid until the next call.
  __device__ const float* next() {
    __pipeline_wait_prior(Stages - 2);
    __syncwarp();
    const int slot = slot_;
    slot_ = slot_ + 1 == Stages ? 0 : slot_ + 1;
    fetch(slot == 0 ? Stages - 1 : slot - 1);
    return ring_ + slot * kStage;
  }

  __device__ void drain() { __pipeline_wait_prior(0); }

 private:
  static constexpr int kSteps = H / kBlockK;
  static constexpr int kWarps = H / kSlab;

  __device__ void fetch(int slot) {
    const int warp = threadIdx.x / 32, lane = threadIdx.x % 32;
    const int product = ahead_ / kSteps, step = ahead_ % kSteps;
    const float* from =
        packed_ + (std::int64_t(product * kWarps + warp) * kSteps + step) * kStage + 4 * lane;
    float* to = ring_ + slot * kStage + 4 * lane;
    for (int i = 0; i < kStage; i += 128) __pipeline_memcpy_async(to + i, from + i, 16);
    __pipeline_commit();
    ahead_ = ahead_ + 1 == total_ ? 0 : ahead_ + 1;
  }

  const float* packed_;
  int total_;
  float* ring_;
  int ahead_ = 0;
  int slot_ = 0;
};

}  // namespace granpinn::cuda::fused
