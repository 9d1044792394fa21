// Products of newton_schulz_cluster.cu: the operands and the outputs of a lane.
//
// A lane is (row, column) = (lane / 16, lane % 16).
//
//   name        shape             outputs of a lane
//   sum         [8][8] of 16x128  [s][4 h + j]: row 2 s + row, column 64 h + 4 column + j
//   sum, Gram   [8][5] of 16x80   [s][t]: row 2 s + row, column `column` of tile t
//   made        [2][8], [2][5]    [d][..]: row 4 warp + 2 d + row, columns as in sum
//   Terms       4 terms of a sum  left [8], right [4][2]: 16 float4 for 256 products
//   GramTerms   4 terms of a sum  left [8], right [5]: 13 float4 for 160 products
#pragma once

#include "cluster_memory.cuh"

namespace granpinn::cuda::cluster {

struct Place {
  int rank, blocks;  // of the cluster; the number of blocks is a power of two
  int warp, lane, row, column;

  // first row of tile t of the matrix, counted from the block's own tile
  __device__ int tile(int t) const { return ((rank + t) & (blocks - 1)) * kRows; }
  // whether the lane's four columns of a row are inside A
  __device__ bool fetches() const { return 4 * lane < blocks * kRows; }
};

// Reads or writes `made` of a product: see above.
__device__ inline void read_outputs(const Place& at, const float* rows, float (&made)[2][8]) {
#pragma unroll
  for (int v = 0; v < 4; ++v) {
    const int d = v / 2, j = v % 2 * 4;
    const float4 from =
        load4(rows + (4 * at.warp + 2 * d + at.row) * kPitch + 16 * j + 4 * at.column);
#pragma unroll
    for (int i = 0; i < 4; ++i) made[d][j + i] = component(from, i);
  }
}
__device__ inline void write_outputs(const Place& at, const float (&made)[2][8], float* rows,
                                     int pitch) {
#pragma unroll
  for (int v = 0; v < 4; ++v) {
    const int d = v / 2, j = v % 2 * 4;
    store4(rows + (4 * at.warp + 2 * d + at.row) * pitch + 16 * j + 4 * at.column,
           make_float4(made[d][j], made[d][j + 1], made[d][j + 2], made[d][j + 3]));
  }
}

// Operands of four terms of a lane's sums.
struct Terms {
  float4 left[8], right[4][2];

  __device__ void load(const float* l, const float* r) {
#pragma unroll
    for (int s = 0; s < 8; ++s) left[s] = load4(l + 2 * s * kPitch);
#pragma unroll
    for (int e = 0; e < 4; ++e)
#pragma unroll
      for (int h = 0; h < 2; ++h) right[e][h] = load4(r + e * kPitch + 64 * h);
  }
  __device__ void add_to(float (&sum)[8][8]) const {
#pragma unroll
    for (int e = 0; e < 4; ++e)
#pragma unroll
      for (int s = 0; s < 8; ++s)
#pragma unroll
        for (int j = 0; j < 8; ++j)
          sum[s][j] += component(left[s], e) * component(right[e][j / 4], j % 4);
  }
};

// Operands of four terms of a lane's sums of X X^T.
struct GramTerms {
  float4 left[8], right[kTiles];

  __device__ void load(const Place& at, const float* X, int k) {
#pragma unroll
    for (int s = 0; s < 8; ++s) left[s] = load4(X + (at.tile(0) + 2 * s + at.row) * kPitch + k);
#pragma unroll
    for (int t = 0; t < kTiles; ++t) right[t] = load4(X + (at.tile(t) + at.column) * kPitch + k);
  }
  __device__ void add_to(float (&sum)[8][kTiles]) const {
#pragma unroll
    for (int e = 0; e < 4; ++e)
#pragma unroll
      for (int s = 0; s < 8; ++s)
#pragma unroll
        for (int t = 0; t < kTiles; ++t)
          sum[s][t] += component(left[s], e) * component(right[t], e);
  }
};

}  // namespace granpinn::cuda::cluster
