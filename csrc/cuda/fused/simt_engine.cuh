// Products of a tile in plain float32: each thread 4 neurons times all channels of PPT points.
#pragma once

#include "weight_stream.cuh"

namespace granpinn::cuda::fused {

template <int Width, int Channels, int PointsPerThread>
struct SimtEngine {
  static constexpr int H = Width;
  static constexpr int C = Channels;
  static constexpr int CP = Channels;  // channels with padding
  static constexpr int PPT = PointsPerThread;
  static constexpr int PT = 4 * PPT;
  static constexpr int R = C * PT;
  static constexpr int ld = H + 4;  // of a panel in shared memory: rows four banks apart
  static constexpr bool tensor_cores = false;
  static constexpr int panel_size = R * ld;
  using Stream = WeightStream<H, 4>;
  using Values = float[CP][PPT][4];

  // A warp is 4 points x 8 groups of neurons.
  static __device__ int lane() { return threadIdx.x % 32; }
  static __device__ int point_lane() { return lane() % 4; }
  static __device__ int neuron_lane() { return lane() / 4; }
  static __device__ int point(int q) { return 4 * q + point_lane(); }
  static __device__ int row(int c, int q) { return c * PT + point(q); }
  static __device__ int column(int j) { return threadIdx.x / 32 * kSlab + neuron_lane() * 4 + j; }
  // sums over the lanes with the same neurons, or with the same points
  static __device__ float sum_points(float a) { return add_lanes(add_lanes(a, 1), 2); }
  static __device__ float sum_neurons(float a) {
    return add_lanes(add_lanes(add_lanes(a, 4), 8), 16);
  }

  static __device__ void load(const float* row, float (&v)[4]) {
    const float4 a = *reinterpret_cast<const float4*>(row + column(0));
    v[0] = a.x, v[1] = a.y, v[2] = a.z, v[3] = a.w;
  }
  static __device__ void store(float* row, const float (&v)[4]) {
    *reinterpret_cast<float4*>(row + column(0)) = make_float4(v[0], v[1], v[2], v[3]);
  }
  // Four neurons of a row into the panel, as operands of the next product; `kept` is what the
  // weights kernel gets.
  template <bool Forward>
  static __device__ void put(float* panel, int row, const float (&a)[4], float (&kept)[4]) {
    store(panel + row * ld, a);
#pragma unroll
    for (int j = 0; j < 4; ++j) kept[j] = a[j];
  }

  // z[row][neuron] = sum_k panel[row][k] W[k][neuron]; `Forward` makes no difference here.
  template <bool Forward>
  static __device__ void multiply(const float* panel, Stream& weights, Values& z) {
#pragma unroll
    for (int c = 0; c < C; ++c)
#pragma unroll
      for (int q = 0; q < PPT; ++q)
#pragma unroll
        for (int j = 0; j < 4; ++j) z[c][q][j] = 0;
    const float* rows = panel + point_lane() * ld;
#pragma unroll 1
    for (int k = 0; k < H; k += kBlockK) {
      const float* w = weights.next() + 4 * (neuron_lane() - lane());
#pragma unroll
      for (int half = 0; half < kBlockK; half += 4) {
        float4 wv[4];
#pragma unroll
        for (int i = 0; i < 4; ++i)
          wv[i] = *reinterpret_cast<const float4*>(w + (half + i) * kSlab);
#pragma unroll
        for (int c = 0; c < C; ++c)
#pragma unroll
          for (int q = 0; q < PPT; ++q) {
            const float4 a =
                *reinterpret_cast<const float4*>(rows + (c * PT + 4 * q) * ld + k + half);
            const float av[4] = {a.x, a.y, a.z, a.w};
#pragma unroll
            for (int i = 0; i < 4; ++i) {
              z[c][q][0] = fmaf(av[i], wv[i].x, z[c][q][0]);
              z[c][q][1] = fmaf(av[i], wv[i].y, z[c][q][1]);
              z[c][q][2] = fmaf(av[i], wv[i].z, z[c][q][2]);
              z[c][q][3] = fmaf(av[i], wv[i].w, z[c][q][3]);
            }
          }
      }
    }
  }
};

}  // namespace granpinn::cuda::fused
