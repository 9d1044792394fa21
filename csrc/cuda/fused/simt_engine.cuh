// Products of a tile in plain float32.
//
//   z[row][n] = sum_k panel[row][k] W[k][n],   row = (channel, point);  k, n: neurons
//
// Parts = 1: a warp sums over all inputs for the 32 neurons of its slab. Parts = 4 (small tiles,
// one on a multiprocessor): four warps share their four slabs. Each warp sums over a quarter of the
// inputs for all 128 neurons; `add_parts` then adds the four sums.
//
//   inputs k       slab s    s ^ 1    s ^ 2    s ^ 3        warp s of four, Parts = 4
//   quarter of   +--------+--------+--------+--------+
//   the warp     | sum 0-3| sum 4-7|    8-11|   12-15|      a thread: 16 neurons x its rows
//                +--------+--------+--------+--------+
//                  kept      sent     sent     sent         to the warp of that slab
//
//   name     shape                          where      layout
//   panel    R rows x H inputs              shared     [channel][point][ld]
//   weights  block_k inputs x 32 Parts      shared     stage [input][slab][8 lanes][4 neurons]
//   sum      CP PPT rows x 4 Parts neurons  registers  `rows` x `sums` of a thread
//   z        CP PPT rows x 4 neurons        registers  Values
//   memory   R x H x (Parts - 1)            shared     float4 [Parts - 1][rows][threads]
//
// Register banks: in a cycle, an instruction reads one register of the even bank and one of the odd
// bank. FFMA runs at full rate if the instruction before used one of its three operands, and the
// other two are in different banks. Three choices follow from this:
//   - the order of the loops;
//   - kSwap: neurons change places in pairs in the stream, so that a sum and its weight are in
//     different banks;
//   - few inputs at a time: in longer code the compiler moves sums to other registers.
#pragma once

#include "lanes.cuh"

namespace granpinn::cuda::fused {

constexpr int kSwap = 1;  // of four weights, number i ^ kSwap belongs to neuron i

template <int Width, int Channels, int Points, int Parts, int StageFloats, int Stages>
struct SimtEngine : Lanes<Width, 1, true> {
  using L = Lanes<Width, 1, true>;
  using L::H, L::neurons;
  static constexpr int C = Channels;
  static constexpr int CP = Channels;  // channels with padding
  static constexpr int PT = Points;
  static constexpr int PPT = PT / 4;  // points of a thread
  static constexpr int R = C * PT;
  static constexpr int ld = row_floats(H);
  static constexpr bool more_rows = false;
  static constexpr int parts = Parts;
  static constexpr int exchange = parts == 1 ? 2 : (parts - 1) * CP * PPT * L::threads * 2;
  using Stream = WeightStream<StageFloats, Stages>;
  using Values = float[CP * PPT][neurons];
  using Element = float;  // of the panels in global memory
  using Stored = float[neurons];

  static __device__ int point(int q) { return 4 * q + L::point_lane(); }
  static __device__ int row(int c, int q) { return c * PT + point(q); }

  // float32 needs no scales.
  static __device__ void note_peaks(const Values&, unsigned*) {}
  static __device__ void remove_scales(Values&, const unsigned*) {}
  static __device__ void store_scales(int*, int, const unsigned*) {}
  static __device__ float scale_of(int, const unsigned*) { return 1; }

  // Writes the neurons of channel c of this thread's point q to the panel, as operands of the next
  // product. `stored` are the values for the weights kernel.
  template <bool Forward>
  static __device__ void put(float* panel, int c, int q, float, const float (&v)[neurons],
                             Stored& stored, Stored&) {
    L::copy_to(panel + row(c, q) * ld + L::column(), v);
#pragma unroll
    for (int j = 0; j < neurons; ++j) stored[j] = v[j];
  }
  static __device__ void store(float* row, const Stored& v) { L::copy_to(row + L::column(), v); }

  // z as above; `Forward` makes no difference here.
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
  static constexpr int rows = CP * PPT;                     // rows of a thread
  static constexpr int sums = 4 * parts;                    // neurons of a thread in a product
  static constexpr int step = 4 * 8 * sums;                 // weights of four inputs
  static constexpr int block_k = StageFloats / (8 * sums);  // inputs of a stage
  static_assert(block_k % 4 == 0 && H / parts % block_k == 0, "whole stages, four inputs a time");

  static __device__ int part() { return L::slab() % parts; }  // the warp's share of the inputs
  // Four inputs of row r of this thread.
  static __device__ float4 four_inputs(const float* inputs, int r) {
    return *reinterpret_cast<const float4*>(inputs + (r / PPT * PT + r % PPT * 4) * ld);
  }
  // The weights of one input for this thread's neurons.
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

  // The same sums. This version has the registers to load the weights of the next input early.
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

  // Adds the sums of the four warps that share four slabs. A thread holds the sums of its own slab
  // first, then those of the slab of warp part() ^ j: pack.cuh orders the weights in the same way.
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
