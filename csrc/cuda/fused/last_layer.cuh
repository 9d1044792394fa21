// The last layer of a tile: K outputs from the activations a of the last hidden layer.
//
//   outputs        raw[row][k] = sum_n W[k][n] a[row][n] + b[k]     b: value rows alone
//   pull_back      g[row][n] = sum_k W[k][n] adjoint[row][k]
//   add_products   dL/dW[k][n] += sum_row adjoint[row][k] a[row][n]
//   add_biases     dL/db[k] += sum of adjoint[row][k] over the value rows
//
//   name          shape            where      layout
//   a, g          R x H            registers  Values of the engine
//   W, b          K x H, K         global     net.narrow; the weights of few values in registers
//   parts         R x K            shared     panel [warp][row][kRow]: sums over a warp's neurons
//   raw, adjoint  R x K            shared     [row][kRow]
//   Sums          K x neurons      registers  of dL/dW, over the thread's rows
//
// `few` (tensor cores, few values of a thread): a thread holds all W of its neurons, and sums eight
// rows at a time. Else it has no registers for that, and takes the outputs one by one.
#pragma once

#include "tile_memory.cuh"

namespace granpinn::cuda::fused {

// Outputs: the largest number K of outputs. Results pass from method to method in `memory`.
template <class E, int Outputs, class Memory>
class LastLayer {
 public:
  using Values = typename E::Values;
  using Sums = float[Outputs][E::neurons];
  static constexpr bool few = kFewValues<E> && sizeof(typename E::Element) == 2;

  __device__ LastLayer(const TileNetwork& net, Memory& memory)
      : m_(memory),
        weights_(net.narrow + net.plan.last()),
        biases_(weights_ + net.plan.outputs * E::H),
        K_(net.plan.outputs) {}

  // Fills memory.raw() from the activations of the last hidden layer.
  __device__ void outputs(const Values& a) {
    static_assert(E::threads % kRow == 0, "a thread has outputs of one kind");
    const int own = threadIdx.x % kRow;
    if constexpr (few) {
      float w[Outputs][N];
      load_weights(w);
      const float bias = own < K_ ? biases_[own] : 0;
      __syncthreads();
      parts_of_few(a, w);
      __syncthreads();
      if (own < K_) add_parts<E::warps>(bias);
    } else {
      __syncthreads();
      parts_of_many(a);
      __syncthreads();
      for (int i = threadIdx.x; i < E::C * E::PT * K_; i += E::threads) {
        const int row = i / K_, k = i % K_;
        float sum = row < E::PT ? biases_[k] : 0;
        for (int w = 0; w < E::warps; ++w) sum += m_.panel[(w * E::R + row) * kRow + k];
        m_.raw()[row * kRow + k] = sum;
      }
    }
    __syncthreads();
  }

  // Adjoints of the activations, from memory.adjoint().
  __device__ void pull_back(Values& g) {
#pragma unroll
    for (int i = 0; i < E::CP * E::PPT * N; ++i) g[i / N][i % N] = 0;
    if constexpr (few) {
      float w[Outputs][N];
      load_weights(w);
#pragma unroll
      for (int i = 0; i < E::C * E::PPT; ++i) {
        float v[Outputs];
        load_adjoints(i / E::PPT, i % E::PPT, v);
#pragma unroll
        for (int k = 0; k < Outputs; ++k)
#pragma unroll
          for (int j = 0; j < N; ++j) g[i][j] = fmaf(v[k], w[k][j], g[i][j]);
      }
    } else {
      for (int k = 0; k < K_; ++k) {
        float w[N];
        E::load(weights_ + k * E::H, w);
#pragma unroll
        for (int c = 0; c < E::C; ++c)
#pragma unroll
          for (int q = 0; q < E::PPT; ++q) {
            const float v = m_.adjoint()[E::row(c, q) * kRow + k];
#pragma unroll
            for (int j = 0; j < N; ++j) g[c * E::PPT + q][j] = fmaf(v, w[j], g[c * E::PPT + q][j]);
          }
      }
    }
  }

  // Adds the products of point q: of all its activations, or of those of neuron j.
  __device__ void add_products(int q, const float (&a)[E::C][E::neurons], Sums& sum) {
#pragma unroll
    for (int c = 0; c < E::C; ++c) {
      float v[Outputs];
      load_adjoints(c, q, v);
#pragma unroll
      for (int k = 0; k < Outputs; ++k)
#pragma unroll
        for (int j = 0; j < N; ++j) sum[k][j] = fmaf(v[k], a[c][j], sum[k][j]);
    }
  }
  __device__ void add_products(int q, int j, const float (&a)[E::C], Sums& sum) {
#pragma unroll
    for (int k = 0; k < Outputs; ++k)
#pragma unroll
      for (int c = 0; c < E::C; ++c)
        sum[k][j] = fmaf(m_.adjoint()[E::row(c, q) * kRow + k], a[c], sum[k][j]);
  }

  // Adds the gradient of the biases. The last threads of the block do this, since the first ones
  // sum the terms of the loss before (tile_kernel.cuh).
  __device__ void add_biases(float* gradient) {
    const int k = E::threads - 1 - static_cast<int>(threadIdx.x);
    if (k >= K_) return;
    float total = 0;
    for (int p = 0; p < E::PT; ++p) total += m_.adjoint()[p * kRow + k];
    gradient[k] += total;
  }

 private:
  static constexpr int N = E::neurons;

  __device__ void load_weights(float (&w)[Outputs][N]) {
#pragma unroll
    for (int k = 0; k < Outputs; ++k) {
#pragma unroll
      for (int j = 0; j < N; ++j) w[k][j] = 0;
      if (k < K_) E::load(weights_ + k * E::H, w[k]);
    }
  }

  __device__ void load_adjoints(int c, int q, float (&v)[Outputs]) {
    static_assert(Outputs == 3 || Outputs == 5, "a row is one float4 and, with five, one more");
    const float* row = m_.adjoint() + E::row(c, q) * kRow;
    const float4 four = *reinterpret_cast<const float4*>(row);
    v[0] = four.x, v[1] = four.y, v[2] = four.z;
    if constexpr (Outputs == 5) v[3] = four.w, v[4] = row[4];
  }

  // Fills `parts` (see above).
  __device__ void parts_of_few(const Values& a, const float (&w)[Outputs][N]) {
    constexpr int rows = E::C * E::PPT;  // of a thread
#pragma unroll
    for (int first = 0; first < rows; first += 8) {
      float total[Outputs];
#pragma unroll
      for (int k = 0; k < Outputs; ++k) {
        float part[8] = {};
#pragma unroll
        for (int i = 0; i < 8; ++i)
#pragma unroll
          for (int j = 0; j < N; ++j)
            if (first + i < rows) part[i] = fmaf(a[first + i][j], w[k][j], part[i]);
        total[k] = E::sum_neurons(part);
      }
      const int r = first + E::neuron_lane();
      if (r >= rows) continue;
      float* to = m_.panel + (threadIdx.x / 32 * E::R + E::row(r / E::PPT, r % E::PPT)) * kRow;
      float4 four{total[0], total[1], total[2], 0};
      if constexpr (Outputs == 5) four.w = total[3], to[4] = total[4];
      *reinterpret_cast<float4*>(to) = four;
    }
  }
  __device__ void parts_of_many(const Values& a) {
    for (int k = 0; k < K_; ++k) {
      float w[N];
      E::load(weights_ + k * E::H, w);
#pragma unroll
      for (int c = 0; c < E::C; ++c)
#pragma unroll
        for (int q = 0; q < E::PPT; ++q) {
          float sum = 0;
#pragma unroll
          for (int j = 0; j < N; ++j) sum = fmaf(a[c * E::PPT + q][j], w[j], sum);
          sum = E::sum_neurons(sum);
          if (E::neuron_lane() == 0)
            m_.panel[(threadIdx.x / 32 * E::R + E::row(c, q)) * kRow + k] = sum;
        }
    }
  }

  template <int Warps>
  __device__ void add_parts(float bias) {
    for (int i = threadIdx.x; i < E::C * E::PT * kRow; i += E::threads) {
      float sum = i < E::PT * kRow ? bias : 0;
#pragma unroll
      for (int w = 0; w < Warps; ++w) sum += m_.panel[w * E::R * kRow + i];
      m_.raw()[i] = sum;
    }
  }

  Memory& m_;
  const float *weights_, *biases_;  // [K][H], [K]
  int K_;
};

}  // namespace granpinn::cuda::fused
