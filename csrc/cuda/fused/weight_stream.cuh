// A warp's stream of hidden weights: from L2 through a ring of stages in shared memory.
//
// The packed weights of a tile lie in the order of their use, so the stream runs on across layers
// and tiles: while a layer's activations are computed, the next layer's weights arrive.
#pragma once

#include <cuda_pipeline_primitives.h>

#include "layout.h"

namespace granpinn::cuda::fused {

template <int StageFloats, int Stages>
class WeightStream {
 public:
  static constexpr int floats = Stages * StageFloats;  // of shared memory, per warp

  WeightStream() = default;  // of nothing

  // `packed` holds the warps' streams one after another, each of `length` floats.
  __device__ WeightStream(const float* packed, std::int64_t length, float* ring)
      : end_(static_cast<int>(length)), ring_(ring + 4 * (threadIdx.x % 32)) {
    if (end_ == 0) return;
    from_ = packed + threadIdx.x / 32 * length + 4 * (threadIdx.x % 32);
    for (int i = 0; i < Stages - 1; ++i) fetch(i);
  }

  // The next stage, complete for all lanes, at this lane's four floats; valid until the next call.
  __device__ const float* next() {
    __pipeline_wait_prior(Stages - 2);
    __syncwarp();
    const int slot = slot_;
    slot_ = slot_ + 1 == Stages ? 0 : slot_ + 1;
    fetch(slot == 0 ? Stages - 1 : slot - 1);
    return ring_ + slot * StageFloats;
  }

  __device__ void drain() { __pipeline_wait_prior(0); }

 private:
  __device__ void fetch(int slot) {
#pragma unroll
    for (int i = 0; i < StageFloats; i += 128)
      __pipeline_memcpy_async(ring_ + slot * StageFloats + i, from_ + ahead_ + i, 16);
    __pipeline_commit();
    ahead_ = ahead_ + StageFloats == end_ ? 0 : ahead_ + StageFloats;
  }

  int end_ = 0;  // of the stream, in floats
  float* ring_ = nullptr;
  const float* from_ = nullptr;
  int ahead_ = 0;
  int slot_ = 0;
};

}  // namespace granpinn::cuda::fused
