// Products of a tile in plain float32: each thread 4 neurons times all channels of its points.
#pragma once

#include "lanes.cuh"

namespace granpinn::cuda::fused {

template <int Width, int Channels, int Points, int Split, int StageFloats, int Stages>
struct SimtEngine : Lanes<Width, Split> {
  using L = Lanes<Width, Split>;
  using L::H, L::neurons;
  static constexpr int C = Channels;
  static constexpr int CP = Channels;  // channels with padding
  static constexpr int PT = Points;
  static constexpr int PPT = PT / 4;  // of a thread
  static constexpr int R = C * PT;
  static constexpr int ld = row_floats(false, H);  // rows four banks apart
  static constexpr bool more_rows = false;
  static constexpr int block_k = StageFloats / kSlab;  // inputs of a stage
  using Stream = WeightStream<StageFloats, Stages>;
  using Values = float[CP * PPT][neurons];
  using Element = float;  // of the panels
  using Stored = float[neurons];

  static __device__ int point(int q) { return 4 * q + L::point_lane(); }
  static __device__ int row(int c, int q) { return c * PT + point(q); }

  // No scales here: float32 has the range.
  static __device__ void note_peaks(const Values&, unsigned*) {}
  static __device__ void remove_scales(Values&, const unsigned*) {}
  static __device__ void store_scales(int*, int, const unsigned*) {}
  static __device__ float scale_of(int, const unsigned*) { return 1; }

  // A thread's neurons of channel c of its point q into the panel, as operands of the next product;
  // `stored` is what the weights kernel gets.
  template <bool Forward>
  static __device__ void put(float* panel, int c, int q, float, const float (&v)[neurons],
                             Stored& stored, Stored&) {
    L::copy_to(panel + row(c, q) * ld + L::column(), v);
#pragma unroll
    for (int j = 0; j < neurons; ++j) stored[j] = v[j];
  }
  static __device__ void store(float* row, const Stored& v) { L::copy_to(row + L::column(), v); }

  // z[row][neuron] = sum_k panel[row][k] W[k][neuron]; `Forward` makes no difference here.
  template <bool Forward>
  static __device__ void multiply(const float* panel, Stream& weights, float2* memory, Values& z) {
    float sum[CP * PPT][4];
#pragma unroll
    for (int i = 0; i < CP * PPT * 4; ++i) sum[i / 4][i % 4] = 0;
    const float* rows = panel + L::point_lane() * ld + L::part() * (H / Split);
#pragma unroll 1
    for (int k = 0; k < H / Split; k += block_k) {
      const float* w = weights.next() + 4 * (L::neuron_lane() - L::lane());
#pragma unroll
      for (int half = 0; half < block_k; half += 4) {
        float4 wv[4];
#pragma unroll
        for (int i = 0; i < 4; ++i)
          wv[i] = *reinterpret_cast<const float4*>(w + (half + i) * kSlab);
#pragma unroll
        for (int r = 0; r < CP * PPT; ++r) {
          const float4 a =
              *reinterpret_cast<const float4*>(rows + (r / PPT * PT + r % PPT * 4) * ld + k + half);
          const float av[4] = {a.x, a.y, a.z, a.w};
#pragma unroll
          for (int i = 0; i < 4; ++i) {
            sum[r][0] = fmaf(av[i], wv[i].x, sum[r][0]);
            sum[r][1] = fmaf(av[i], wv[i].y, sum[r][1]);
            sum[r][2] = fmaf(av[i], wv[i].z, sum[r][2]);
            sum[r][3] = fmaf(av[i], wv[i].w, sum[r][3]);
          }
        }
      }
    }
    L::exchange(memory, sum, z);
  }
};

}  // namespace granpinn::cuda::fused
