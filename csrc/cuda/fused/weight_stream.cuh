// A warp's stream of hidden weights: from L2 through a ring of stages in shared memory.
//
//   packed, global   | stage 0 | stage 1 | stage 2 | ... | last stage |   then stage 0 again
//                                 |  cp.async, 16 bytes a lane
//   ring, shared     | slot 0: read by the warp | slot 1: arriving | ... | slot Stages - 1 |
//
//   name      shape                  where    layout
//   packed    [warps][length]        global   in the order of use: pack.cuh
//   ring      [Stages][StageFloats]  shared   one ring for each warp
//
// The stream does not stop between layers and tiles: the weights of the next layer arrive while the
// activations of this layer are computed. Stages - 1 stages are under way or ready at any time.
#pragma once

#include <cuda_pipeline_primitives.h>

#include "layout.h"

namespace granpinn::cuda::fused {

template <int StageFloats, int Stages>
class WeightStream {
 public:
  static constexpr int floats = Stages * StageFloats;  // of shared memory, per warp

  WeightStream() = default;  // an empty stream

  // `packed` holds the warps' streams one after another, each of `length` floats.
  __device__ WeightStream(const float* packed, std::int64_t length, float* ring)
      : end_(static_cast<int>(length)), ring_(ring + 4 * (threadIdx.x % 32)) {
    if (end_ == 0) return;
    from_ = packed + threadIdx.x / 32 * length + 4 * (threadIdx.x % 32);
    for (int i = 0; i < Stages - 1; ++i) fetch(i);
  }

  // Waits for the next stage, and returns the address of this lane's four floats in it. The stage
  // is complete for all lanes, and stays valid until the next call.
  __device__ const float* next() {
    __pipeline_wait_prior(Stages - 2);
    __syncwarp();
    const int slot = slot_;
    slot_ = slot_ + 1 == Stages ? 0 : slot_ + 1;
    fetch(slot == 0 ? Stages - 1 : slot - 1);
    return ring_ + slot * StageFloats;
  }

  // Waits for the stages that were fetched ahead.
  __device__ void drain() { __pipeline_wait_prior(0); }

 private:
  __device__ void fetch(int slot) {
#pragma unroll
    for (int i = 0; i < StageFloats; i += 128)
      __pipeline_memcpy_async(ring_ + slot * StageFloats + i, from_ + ahead_ + i, 16);
    __pipeline_commit();
    ahead_ = ahead_ + StageFloats == end_ ? 0 : ahead_ + StageFloats;
  }

  int end_ = 0;  // length of the stream, in floats
  float* ring_ = nullptr;
  const float* from_ = nullptr;
  int ahead_ = 0;  // position of the next stage to fetch, in floats
  int slot_ = 0;   // slot of the next stage to read
};

}  // namespace granpinn::cuda::fused
