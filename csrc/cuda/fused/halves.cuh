// Numbers as half-precision pieces with power-of-two scales, and the tensor-core instruction.
//
//   x 2^s = high + low,   high = half(x 2^s),  low = half(x 2^s - high)
//
// A half has the 11 significant bits of TF32, and tensor cores multiply halves at twice the rate.
// Its range is short, hence the scales:
//
//   operand                     exponent s
//   a channel of a tile         the largest |x| comes to [2^14, 2^15)
//   weights                     kWeightExponent; a weight beyond +-255 makes the loss infinite
#pragma once

#include <cuda_fp16.h>

namespace granpinn::cuda::fused {

constexpr int kWeightExponent = 8;
constexpr int kNoScale = 1 << 20;  // exponent of rows that are all zero

// Tensor cores truncate sums. A sum over a block of 16 inputs loses a third of its last place on
// average (measured on an H200). The loss is the same in all points, so it does not average out.
// The product of these two factors restores it; no single float32 is that close to 1. The first
// factor multiplies the sum of each block, the second their total. (The strong form does not use
// them: its error in float32 is larger.)
constexpr float kBlockFactor = 1.2421875f, kSumFactor = 0x1.9c2d16p-1f;
constexpr double kGivenBack = (double{kBlockFactor} * double{kSumFactor} - 1) * (1 << 23);
static_assert(0.33 < kGivenBack && kGivenBack < 0.34, "a third of the last place");

// Two numbers as halves, the first in the lower bits; and the remainders of that rounding.
__device__ inline unsigned to_halves(float a, float b) {
  const __half2 h = __floats2half2_rn(a, b);
  return *reinterpret_cast<const unsigned*>(&h);
}
__device__ inline unsigned rest_of_halves(unsigned halves, float a, float b) {
  const float2 f = __half22float2(*reinterpret_cast<const __half2*>(&halves));
  return to_halves(a - f.x, b - f.y);
}

// d = a b + c
__device__ inline void mma_f16(float (&d)[4], uint4 a, unsigned b0, unsigned b1,
                               const float (&c)[4]) {
  asm("mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 {%0,%1,%2,%3}, {%4,%5,%6,%7}, {%8,%9}, "
      "{%10,%11,%12,%13};"
      : "=f"(d[0]), "=f"(d[1]), "=f"(d[2]), "=f"(d[3])
      : "r"(a.x), "r"(a.y), "r"(a.z), "r"(a.w), "r"(b0), "r"(b1), "f"(c[0]), "f"(c[1]), "f"(c[2]),
        "f"(c[3]));
}

// peak: largest |x| of a channel, as the bits of a float. Returns s with |x| 2^s in [2^14, 2^15),
// less if |x| < 2^-87, and 0 if the peak is zero. 2^s and 2^(-s - kWeightExponent) are normal.
__device__ inline int scale_exponent(unsigned peak) {
  const int exponent = static_cast<int>(peak >> 23);
  return exponent == 0 ? 0 : 141 - max(exponent, 40);
}
__device__ inline float power_of_two(int exponent) {
  return __uint_as_float(static_cast<unsigned>(127 + exponent) << 23);
}

}  // namespace granpinn::cuda::fused
