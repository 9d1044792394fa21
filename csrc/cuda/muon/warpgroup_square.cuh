// Products of 128 x 128 half-precision squares by warpgroups (wgmma), for compute capability 9.0.
//
// A square lies in shared memory as two halves of 64 columns, each [128 rows][128 bytes]. The eight
// chunks of 16 bytes of a row are permuted as the hardware's 128-byte swizzle wants them: chunk c
// of row r lies at position c ^ (r % 8).
//
//   bytes       0 .. 16383           16384 .. 32767
//             +--------------------+--------------------+
//   row 0     | columns 0 .. 63    | columns 64 .. 127  |
//   row 1     |                    |                    |
//    ...
//
// The same bytes serve as a left operand, as a right operand whose rows are summed over, and as a
// right operand whose columns are summed over. So no square is ever transposed.
//
// A warpgroup of four warps computes 64 rows of a product. A lane has sums [16][4]: of tile j, the
// columns 8 j + 2 (lane % 4) + {0, 1} of row lane / 4 (the first two) and row lane / 4 + 8 of the
// warp's 16.
#pragma once

#include "iteration.cuh"

namespace granpinn::cuda::warpgroup {

constexpr int kColumnsOfHalf = 64;
constexpr int kRowBytes = 2 * kColumnsOfHalf;
constexpr int kHalfBytes = kSide * kRowBytes;
constexpr int kBytes = 2 * kHalfBytes;
constexpr int kInputs = 16;  // that one instruction sums over

using Sums = float[16][4];

// Address of chunk `chunk` of 8 numbers of a row.
__device__ inline unsigned chunk_address(unsigned square, int row, int chunk) {
  return square + chunk / 8 * kHalfBytes + row * kRowBytes + (chunk % 8 ^ row % 8) * 16;
}

// The hardware's description of an operand from `address` on; distances in units of 16 bytes.
__device__ inline unsigned long long describe(unsigned address, int leading, int stride) {
  constexpr unsigned long long swizzle_of_128_bytes = 1ull << 62;
  return swizzle_of_128_bytes | static_cast<unsigned long long>(stride) << 32 |
         static_cast<unsigned long long>(leading) << 16 | (address & 0x3ffff) >> 4;
}
// Rows from `row` on; inputs 16 k .. 16 k + 15 are columns.
__device__ inline unsigned long long by_columns(unsigned square, int row, int k) {
  return describe(square + k / 4 * kHalfBytes + row * kRowBytes + k % 4 * 32, 1,
                  8 * kRowBytes / 16);
}
// All columns; inputs 16 k .. 16 k + 15 are rows.
__device__ inline unsigned long long by_rows(unsigned square, int k) {
  return describe(square + k * kInputs * kRowBytes, kHalfBytes / 16, 8 * kRowBytes / 16);
}

// Makes stores to shared memory visible to the products of the block's warpgroups.
__device__ inline void publish() {
  asm volatile("fence.proxy.async.shared::cta;" ::: "memory");
  __syncthreads();
}

// d += a b, 64 x 128 by 16 inputs, begun. RightByRows: b is described by_rows.
template <bool RightByRows>
__device__ inline void begin_product(Sums& d, unsigned long long a, unsigned long long b) {
  asm volatile(
      "wgmma.mma_async.sync.aligned.m64n128k16.f32.f16.f16 "
      "{%0, %1, %2, %3, %4, %5, %6, %7, %8, %9, %10, %11, %12, %13, %14, %15, "
      "%16, %17, %18, %19, %20, %21, %22, %23, %24, %25, %26, %27, %28, %29, %30, %31, "
      "%32, %33, %34, %35, %36, %37, %38, %39, %40, %41, %42, %43, %44, %45, %46, %47, "
      "%48, %49, %50, %51, %52, %53, %54, %55, %56, %57, %58, %59, %60, %61, %62, %63}, "
      "%64, %65, 1, 1, 1, 0, %66;"
#define GRANPINN_TILE(j) "+f"(d[j][0]), "+f"(d[j][1]), "+f"(d[j][2]), "+f"(d[j][3])
      : GRANPINN_TILE(0), GRANPINN_TILE(1), GRANPINN_TILE(2), GRANPINN_TILE(3), GRANPINN_TILE(4),
        GRANPINN_TILE(5), GRANPINN_TILE(6), GRANPINN_TILE(7), GRANPINN_TILE(8), GRANPINN_TILE(9),
        GRANPINN_TILE(10), GRANPINN_TILE(11), GRANPINN_TILE(12), GRANPINN_TILE(13),
        GRANPINN_TILE(14), GRANPINN_TILE(15)
#undef GRANPINN_TILE
      : "l"(a), "l"(b), "n"(RightByRows ? 1 : 0));
}

// d += left right over all inputs. left: rows from `row` on, by columns. (An instruction that a
// smaller matrix does not need costs less than a branch: the next one would wait for the sums.)
template <bool RightByRows>
__device__ inline void add_product(Sums& d, unsigned left, int row, unsigned right) {
  asm volatile("wgmma.fence.sync.aligned;" ::: "memory");
#pragma unroll
  for (int k = 0; k < kSide / kInputs; ++k)
    begin_product<RightByRows>(d, by_columns(left, row, k),
                               RightByRows ? by_rows(right, k) : by_columns(right, 0, k));
  asm volatile("wgmma.commit_group.sync.aligned;" ::: "memory");
  asm volatile("wgmma.wait_group.sync.aligned 0;" ::: "memory");
}

// Stores a warp's sums, rounded to halves, to the rows from `row` on.
__device__ inline void store(unsigned square, int row, const Sums& d) {
  const int lane = threadIdx.x % 32;
#pragma unroll
  for (int j = 0; j < 16; j += 2) {
    unsigned both[4];
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      const float* two = d[j + i / 2] + i % 2 * 2;
      both[i] = pack(two[0], two[1]);
    }
    asm volatile("stmatrix.sync.aligned.m8n8.x4.shared.b16 [%0], {%1, %2, %3, %4};" ::"r"(
                     chunk_address(square, row + lane % 16, j + lane / 16)),
                 "r"(both[0]), "r"(both[1]), "r"(both[2]), "r"(both[3])
                 : "memory");
  }
}

}  // namespace granpinn::cuda::warpgroup
