// How the kernels of a step note a fault (csrc/step.h).
#pragma once

#include "../step.h"

namespace granpinn::cuda {

// A fault is the minimum of what the threads find, an integer, so the order in which they find it
// changes nothing.
__device__ inline void note(std::int64_t* fault, std::int64_t step, Fault what) {
  atomicMin(reinterpret_cast<long long*>(fault), static_cast<long long>(step * kFaults + what));
}

}  // namespace granpinn::cuda
