// Notes a fault of a member in a step (csrc/step.h).
#pragma once

#include "../step.h"

namespace granpinn::cuda {

// The minimum over all threads: the first fault. The order of the threads does not matter.
__device__ inline void note(std::int64_t* fault, std::int64_t step, Fault what) {
  atomicMin(reinterpret_cast<long long*>(fault), static_cast<long long>(fault_code(step, what)));
}

}  // namespace granpinn::cuda
