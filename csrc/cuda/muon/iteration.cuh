// What both iterations of newton_schulz_half.cu share.
//
//   member                    meaning
//   pair(v)                   the thread's pair v of X: two neighbours of a row, float32 registers
//   row(v), column(v)         its place in X
//   store(square)             rounds X to a square of half-precision numbers in shared memory
//   publish()                 makes what was stored visible to the products of all warps
//   advance(A, P, X, r, c)    X <- a X + P X, with A = X X^T and P = b A + c A^2 in other squares;
//                             the square X holds the rounded X, of 16 r rows and 16 c columns
#pragma once

#include <cuda_fp16.h>

namespace granpinn::cuda {

constexpr int kSide = 128;
constexpr int kPairs = 32;  // of a thread
constexpr float kA = 3.4445f, kB = -4.7750f, kC = 2.0315f;

// Two numbers rounded to halves, the first in the lower bits.
__device__ inline unsigned pack(float low, float high) {
  const __half2 both = __floats2half2_rn(low, high);
  return *reinterpret_cast<const unsigned*>(&both);
}

}  // namespace granpinn::cuda
