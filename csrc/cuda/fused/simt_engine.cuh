// Products of a tile in plain float32: each thread 4 neurons times all channels of its points or,
// where a multiprocessor has one small tile, 16 neurons and a quarter of the inputs.
//
// An instruction reads one register of each of two banks, even and odd ones, in a cycle: FFMA comes
// at full rate if one of its three operands is that of the instruction before and the other two are
// in different banks. Hence the order of the loops; neurons change places in pairs in the stream of
// weights (`kSwap`), so that a sum and its weight are in different banks; and few inputs at a time,
// as the compiler moves sums to other registers in longer code.
#pragma once

#include "lanes.cuh"

namespace granpinn::cuda::fused {

constexpr int kSwap = 1;  // weight i ^ kSwap of four is that of neuron i

// With Parts = 4, four warps share 4 x 32 neurons: each sums over a quarter of the inputs.
template <int Width, int Channels, int Points, int Parts, int StageFloats, int Stages>
struct SimtEngine : Lanes<Width, 1, true> {
  using L = Lanes<Width, 1, true>;
  using L::H, L::neurons;
  static constexpr int C = Channels;
  static constexpr int CP = Channels;  // channels with padding
  static constexpr int PT = Points;
  static constexpr int PPT = PT / 4;  // of a thread
  static constexpr int R = C * PT;
  static constexpr int ld = row_floats(H);
  static constexpr bool more_rows = false;
  static constexpr int parts = Parts;
  static constexpr int exchange = parts == 1 ? 2 : (parts - 1) * CP * PPT * L::threads * 2;
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
    float sum[rows][sums];
#pragma unroll
    for (int i = 0; i < rows * sums; ++i) sum[i / sums][i % sums] = 0;
    const float* inputs = panel + L::point_lane() * ld + part() * (H / parts);
    if constexpr (parts == 1)
      add_products(inputs, weights, sum);
    else
      add_products_ahead(inputs, weights, sum);
    add_parts(reinterpret_cast<float4*>(memory), sum, z);
  }

 private:
  static constexpr int rows = CP * PPT;                     // of a thread
  static constexpr int sums = 4 * parts;                    // its neurons in a product
  static constexpr int step = 4 * 8 * sums;                 // weights of four inputs
  static constexpr int block_k = StageFloats / (8 * sums);  // inputs of a stage
  static_assert(block_k % 4 == 0 && H / parts % block_k == 0, "whole stages, four inputs a time");

  static __device__ int part() { return L::slab() % parts; }  // of the inputs
  // Four inputs of row r of this thread's.
  static __device__ float4 four_inputs(const float* inputs, int r) {
    return *reinterpret_cast<const float4*>(inputs + (r / PPT * PT + r % PPT * 4) * ld);
  }
  // This thread's weights of an input.
  static __device__ void load_weights(const float* from, float4 (&w)[parts]) {
#pragma unroll
    for (int b = 0; b < parts; ++b) w[b] = reinterpret_cast<const float4*>(from)[b * 8];
  }
  static __device__ const float* next_stage(Stream& weights) {
    return weights.next() + 4 * (L::neuron_lane() - L::lane());
  }
  static __device__ void add_product(float a, const float4 (&w)[parts], float (&sum)[sums]) {
#pragma unroll
    for (int j = 0; j < sums; ++j) sum[j] = fmaf(a, element(w[j / 4], j % 4 ^ kSwap), sum[j]);
  }

  static __device__ void add_products(const float* inputs, Stream& weights,
                                      float (&sum)[rows][sums]) {
#pragma unroll 1
    for (int k = 0; k < H / parts; k += block_k) {
      const float* from = next_stage(weights);
#pragma unroll 1
      for (int i = 0; i < block_k; i += 4, inputs += 4, from += step) {
        float4 w[4][parts];
#pragma unroll
        for (int n = 0; n < 4; ++n) load_weights(from + n * (step / 4), w[n]);
#pragma unroll
        for (int r = 0; r < rows; ++r) {
          const float4 a = four_inputs(inputs, r);
#pragma unroll
          for (int n = 0; n < 4; ++n) add_product(element(a, n), w[n], sum[r]);
        }
      }
    }
  }

  // Likewise, with the registers to read an input ahead.
  static __device__ void add_products_ahead(const float* inputs, Stream& weights,
                                            float (&sum)[rows][sums]) {
    constexpr int last = H / parts - 4;
    const float* from = next_stage(weights);
    float4 a[rows], w[2][parts];
#pragma unroll
    for (int r = 0; r < rows; ++r) a[r] = four_inputs(inputs, r);
    load_weights(from, w[0]);
#pragma unroll 1
    for (int k = 0; k <= last; k += 4) {
#pragma unroll
      for (int n = 0; n < 4; ++n) {
        if (n == 3 && k < last) {
          inputs += 4;
          from = (k + 4) % block_k == 0 ? next_stage(weights) : from + step;
        }
        load_weights(n == 3 ? from : from + (n + 1) * (step / 4), w[(n + 1) % 2]);
#pragma unroll
        for (int r = 0; r < rows; ++r) {
          add_product(element(a[r], n), w[n % 2], sum[r]);
          if (n == 3) a[r] = four_inputs(inputs, r);
        }
      }
    }
  }

  // Warps with the same neurons give each other their sums. Those of the thread's own four neurons
  // are first, then those of warp `part() ^ j`; so the weights lie (see pack.cuh).
  static __device__ void add_parts(float4* memory, const float (&sum)[rows][sums], Values& z) {
    float4* group = memory + L::slab() / parts * (32 * parts) + L::lane();
#pragma unroll
    for (int j = 1; j < parts; ++j) {
      float4* to = group + (part() ^ j) * 32 + (j - 1) * rows * L::threads;
#pragma unroll
      for (int r = 0; r < rows; ++r)
        to[r * L::threads] =
            make_float4(sum[r][4 * j], sum[r][4 * j + 1], sum[r][4 * j + 2], sum[r][4 * j + 3]);
    }
    if constexpr (parts > 1)
      asm volatile("bar.sync %0, %1;" ::"r"(1 + L::slab() / parts), "n"(32 * parts) : "memory");
#pragma unroll
    for (int r = 0; r < rows; ++r) {
#pragma unroll
      for (int i = 0; i < neurons; ++i) z[r][i] = sum[r][i];
#pragma unroll
      for (int j = 1; j < parts; ++j) {
        const float4 other = group[part() * 32 + ((j - 1) * rows + r) * L::threads];
#pragma unroll
        for (int i = 0; i < neurons; ++i) z[r][i] += element(other, i);
      }
    }
  }
};

}  // namespace granpinn::cuda::fused
