// Squares of 128 x 128 half-precision numbers in shared memory, and their products on tensor cores.
//
// A row is 256 bytes: 16 chunks of 8 numbers. Chunk c of row r lies at position c ^ (r % 8), so
// that the eight rows of any 8 x 8 matrix lie in different banks:
//
//   position   0  1  2  3  4  5  6  7   8 ..
//   row 0      0  1  2  3  4  5  6  7   8 ..      entries: chunks
//   row 1      1  0  3  2  5  4  7  6   9 ..
//   row 2      2  3  0  1  6  7  4  5  10 ..
//    ...
//
// A Fragment is 16 x 16 numbers: the left operand of mma.m16n8k16 or, of a matrix that is stored by
// its columns, two right operands. It is four 8 x 8 matrices x[i]; a lane has two numbers of each:
//
//           columns 0-7   8-15                       columns 0-7   8-15
//   rows 0-7    x[0]      x[2]              rows 0-7     x[0]      x[1]
//   rows 8-15   x[1]      x[3]     left     rows 8-15    x[2]      x[3]     right
#pragma once

#include <cuda_fp16.h>

#include "iteration.cuh"

namespace granpinn::cuda::half_square {

constexpr int kRowBytes = 2 * kSide;
constexpr int kBytes = kSide * kRowBytes;

using Sum = float[4];  // columns 2 (lane % 4) + {0, 1} of rows lane / 4 and lane / 4 + 8

struct Fragment {
  unsigned x[4];
};

// Address of the row of 8 numbers that a lane loads for the fragment at (0, 0) of a square. For
// other fragments: + kRowBytes for each row (a multiple of 8), ^ 32 k for column 16 k.
__device__ inline unsigned left_lane(int lane) {
  return lane % 16 * kRowBytes + (lane / 16 ^ lane % 8) * 16;
}
__device__ inline unsigned right_lane(int lane) {
  return (lane % 8 + lane / 16 * 8) * kRowBytes + (lane / 8 % 2 ^ lane % 8) * 16;
}
// The right operand from the left one, for a fragment on the diagonal.
__device__ inline Fragment right_of(const Fragment& left) {
  return {{left.x[0], left.x[2], left.x[1], left.x[3]}};
}

__device__ inline Fragment load(unsigned at) {
  Fragment f;
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.shared.b16 {%0, %1, %2, %3}, [%4];"
               : "=r"(f.x[0]), "=r"(f.x[1]), "=r"(f.x[2]), "=r"(f.x[3])
               : "r"(at)
               : "memory");
  return f;
}
// Transposes the 8 x 8 matrices: at left_lane, it loads a right operand that is stored by its rows.
__device__ inline Fragment load_flipped(unsigned at) {
  Fragment f;
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.trans.shared.b16 {%0, %1, %2, %3}, [%4];"
               : "=r"(f.x[0]), "=r"(f.x[1]), "=r"(f.x[2]), "=r"(f.x[3])
               : "r"(at)
               : "memory");
  return f;
}

__device__ inline void multiply_add(Sum& d, const Fragment& a, unsigned b0, unsigned b1) {
  asm("mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 {%0, %1, %2, %3}, {%4, %5, %6, %7}, "
      "{%8, %9}, {%0, %1, %2, %3};"
      : "+f"(d[0]), "+f"(d[1]), "+f"(d[2]), "+f"(d[3])
      : "r"(a.x[0]), "r"(a.x[1]), "r"(a.x[2]), "r"(a.x[3]), "r"(b0), "r"(b1));
}

template <int M, int N>
__device__ inline void multiply_add(Sum (&d)[M][2 * N], const Fragment (&left)[M],
                                    const Fragment (&right)[N]) {
#pragma unroll
  for (int j = 0; j < 2 * N; ++j)
#pragma unroll
    for (int i = 0; i < M; ++i)
      multiply_add(d[i][j], left[i], right[j / 2].x[j % 2 * 2], right[j / 2].x[j % 2 * 2 + 1]);
}

__device__ inline void store(unsigned at, unsigned both) {
  asm volatile("st.shared.b32 [%0], %1;" ::"r"(at), "r"(both) : "memory");
}
__device__ inline unsigned transpose(unsigned both) {
  unsigned out;
  asm volatile("movmatrix.sync.aligned.m8n8.trans.b16 %0, %1;" : "=r"(out) : "r"(both));
  return out;
}

// Stores an 8 x 8 matrix to row 8 I and column 8 J. both: a lane's two numbers of row lane / 4.
__device__ inline void store_matrix(unsigned square, int I, int J, int lane, unsigned both) {
  store(square + (8 * I + lane / 4) * kRowBytes + (J ^ lane / 4) * 16 + lane % 4 * 4, both);
}

// Stores sums to row 16 I and column 8 J of a square. Mirrored: to the transposed place, too.
template <int M, int N, bool Mirrored>
__device__ inline void store_tile(unsigned square, int I, int J, int lane, const Sum (&d)[M][N]) {
#pragma unroll
  for (int i = 0; i < M; ++i)
#pragma unroll
    for (int j = 0; j < N; ++j)
#pragma unroll
      for (int h = 0; h < 2; ++h) {
        const int row = 2 * (I + i) + h, column = J + j;
        const unsigned both = pack(d[i][j][2 * h], d[i][j][2 * h + 1]);
        store_matrix(square, row, column, lane, both);
        if (Mirrored) store_matrix(square, column, row, lane, transpose(both));
      }
}

}  // namespace granpinn::cuda::half_square
