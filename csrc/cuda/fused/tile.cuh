// A tile of points through the network and back, by one block; E is an engine of products.
#pragma once

#include "math/jet.h"
#include "mma_engine.cuh"
#include "simt_engine.cuh"

namespace granpinn::cuda::fused {

// Shared memory of a block, for tiles of R rows. H threads, H / 32 warps.
template <class E>
struct TileMemory {
  static constexpr int warps = E::H / 32;
  float panel[E::panel_size];  // operands of a product [row][neuron]; then parts of the outputs
  float ring[warps * E::Stream::kFloats];  // weights
  float raw[E::R * kRow];                  // raw outputs [row][K]
  float adjoint[E::R * kRow];              // their adjoints
  float xi[3 * E::R];                      // mapped coordinates [3][point]
  float observed[4 * E::R];                // of the points: what the task needs
  float terms[kSums * E::R];               // what each point adds to the sums
  float scale[4];
};

// What a block knows of its member's network.
struct TileNetwork {
  Plan plan;
  const float* narrow;  // weights of the first and last layer, biases
  float* stash;         // this block's, in shared or in global memory
  float* activations;   // of this member: [L - 1][panel]
  float* adjoints;
  float* gradient;  // of the narrow parameters, in shared memory
};

template <class E, class Memory>
class Tile {
 public:
  using Values = typename E::Values;

  __device__ Tile(const TileNetwork& net, Memory& memory, typename E::Stream& weights,
                  std::int64_t first_row)
      : net_(net), m_(memory), weights_(weights), first_row_(first_row) {}

  // Fills memory.raw; keeps the last hidden layer's pre-activations.
  __device__ void forward() {
    Values a;
    const int L = net_.plan.hidden;
    first_layer(z_);
    activate(z_, a);
    for (int l = 1; l < L; ++l) {
      __syncthreads();
      put<true>(a, net_.activations + (l - 1) * net_.plan.panel());
      __syncthreads();
      float b[4];  // on its way during the product
      E::load(net_.narrow + net_.plan.bias(l), b);
      E::template multiply<true>(m_.panel, weights_, z_);
#pragma unroll
      for (int q = 0; q < E::PPT; ++q)
#pragma unroll
        for (int j = 0; j < 4; ++j) z_[0][q][j] += b[j];
      if (l < L - 1) stash(l, z_);
      activate(z_, a);
    }
    outputs(a);
  }

  // From memory.adjoint: adds to the narrow gradients, leaves the adjoints of the hidden layers.
  __device__ void backward() {
    const int L = net_.plan.hidden;
    Values g;
    for (int l = L - 1; l >= 0; --l) {
      if (l == L - 1) {
        last_layer_adjoint(g);
      } else {
        __syncthreads();
        E::template multiply<false>(m_.panel, weights_, g);
        if (l == 0)
          first_layer(z_);
        else
          recall(l, z_);
      }
      Values a;
      activate_adjoint(z_, a, g);
      if (l == L - 1) last_layer_gradient(a);
      float b[4];
#pragma unroll
      for (int j = 0; j < 4; ++j) {
        b[j] = 0;
#pragma unroll
        for (int q = 0; q < E::PPT; ++q) b[j] += g[0][q][j];
      }
      add(net_.plan.bias(l), b);
      if (l > 0) {
        __syncthreads();
        put<false>(g, net_.adjoints + (l - 1) * net_.plan.panel());
      } else {
        first_layer_gradient(g);
      }
    }
  }

 private:
  // z of the first layer: the coordinates' own jets are (xi, e_i, 0)
  __device__ void first_layer(Values& z) {
    float w[3][4], b[4];
#pragma unroll
    for (int i = 0; i < 3; ++i) E::load(net_.narrow + i * E::H, w[i]);
    E::load(net_.narrow + net_.plan.bias(0), b);
#pragma unroll
    for (int q = 0; q < E::PPT; ++q)
#pragma unroll
      for (int j = 0; j < 4; ++j) {
        float value = b[j];
#pragma unroll
        for (int i = 0; i < 3; ++i) value = fmaf(w[i][j], m_.xi[i * E::R + E::point(q)], value);
        z[0][q][j] = value;
#pragma unroll
        for (int c = 1; c < E::CP; ++c)
          z[c][q][j] = c < 4 ? w[c < 4 ? c - 1 : 0][j] * m_.scale[c < 4 ? c - 1 : 0] : 0;
      }
  }

  __device__ void activate(const Values& z, Values& a) {
#pragma unroll
    for (int q = 0; q < E::PPT; ++q)
#pragma unroll
      for (int j = 0; j < 4; ++j) {
        float zc[E::C], ac[E::C];
#pragma unroll
        for (int c = 0; c < E::C; ++c) zc[c] = z[c][q][j];
        activation_jet<E::C>(zc, ac);
#pragma unroll
        for (int c = 0; c < E::CP; ++c) a[c][q][j] = c < E::C ? ac[c < E::C ? c : 0] : 0;
      }
  }

  __device__ void activate_adjoint(const Values& z, Values& a, Values& g) {
#pragma unroll
    for (int q = 0; q < E::PPT; ++q)
#pragma unroll
      for (int j = 0; j < 4; ++j) {
        float zc[E::C], ac[E::C], gc[E::C];
#pragma unroll
        for (int c = 0; c < E::C; ++c) zc[c] = z[c][q][j], gc[c] = g[c][q][j];
        activation_jet_adjoint<E::C>(zc, ac, gc);
#pragma unroll
        for (int c = 0; c < E::CP; ++c) {
          a[c][q][j] = c < E::C ? ac[c < E::C ? c : 0] : 0;
          g[c][q][j] = c < E::C ? gc[c < E::C ? c : 0] : 0;
        }
      }
  }

  // Into the panel, for the next product, and to global memory, for the weights' gradient.
  template <bool Forward>
  __device__ void put(const Values& a, float* to) {
#pragma unroll
    for (int c = 0; c < E::CP; ++c)
#pragma unroll
      for (int q = 0; q < E::PPT; ++q) {
        float kept[4];
        E::template put<Forward>(m_.panel, E::row(c, q), a[c][q], kept);
        E::store(to + (first_row_ + E::row(c, q)) * E::H, kept);
      }
  }

  __device__ float4* stash_of(int layer) {
    constexpr int values = E::C * E::PPT;
    return reinterpret_cast<float4*>(net_.stash) + (layer - 1) * values * E::H + threadIdx.x;
  }
  __device__ void stash(int layer, const Values& z) {
    float4* to = stash_of(layer);
#pragma unroll
    for (int c = 0; c < E::C; ++c)
#pragma unroll
      for (int q = 0; q < E::PPT; ++q)
        to[(c * E::PPT + q) * E::H] = *reinterpret_cast<const float4*>(z[c][q]);
  }
  __device__ void recall(int layer, Values& z) {
    const float4* from = stash_of(layer);
#pragma unroll
    for (int c = 0; c < E::C; ++c)
#pragma unroll
      for (int q = 0; q < E::PPT; ++q) {
        const float4 v = from[(c * E::PPT + q) * E::H];
        z[c][q][0] = v.x, z[c][q][1] = v.y, z[c][q][2] = v.z, z[c][q][3] = v.w;
      }
  }

  __device__ void outputs(const Values& a) {
    constexpr int warps = Memory::warps;
    const int K = net_.plan.outputs, warp = threadIdx.x / 32;
    __syncthreads();
    for (int k = 0; k < K; ++k) {
      float w[4];
      E::load(net_.narrow + net_.plan.last() + k * E::H, w);
#pragma unroll
      for (int c = 0; c < E::C; ++c)
#pragma unroll
        for (int q = 0; q < E::PPT; ++q) {
          float sum = 0;
#pragma unroll
          for (int j = 0; j < 4; ++j) sum = fmaf(a[c][q][j], w[j], sum);
          sum = E::sum_neurons(sum);
          if (E::neuron_lane() == 0) m_.panel[(warp * E::R + E::row(c, q)) * kRow + k] = sum;
        }
    }
    __syncthreads();
    const float* bias = net_.narrow + net_.plan.last() + K * E::H;
    for (int i = threadIdx.x; i < E::C * E::PT * K; i += E::H) {
      const int row = i / K, k = i % K;
      float sum = row < E::PT ? bias[k] : 0;
      for (int w = 0; w < warps; ++w) sum += m_.panel[(w * E::R + row) * kRow + k];
      m_.raw[row * kRow + k] = sum;
    }
    __syncthreads();
  }

  __device__ void last_layer_adjoint(Values& g) {
#pragma unroll
    for (int c = 0; c < E::CP; ++c)
#pragma unroll
      for (int q = 0; q < E::PPT; ++q)
#pragma unroll
        for (int j = 0; j < 4; ++j) g[c][q][j] = 0;
    for (int k = 0; k < net_.plan.outputs; ++k) {
      float w[4];
      E::load(net_.narrow + net_.plan.last() + k * E::H, w);
#pragma unroll
      for (int c = 0; c < E::C; ++c)
#pragma unroll
        for (int q = 0; q < E::PPT; ++q) {
          const float v = m_.adjoint[E::row(c, q) * kRow + k];
#pragma unroll
          for (int j = 0; j < 4; ++j) g[c][q][j] = fmaf(v, w[j], g[c][q][j]);
        }
    }
  }

  __device__ void last_layer_gradient(const Values& a) {
    const int K = net_.plan.outputs;
    for (int k = 0; k < K; ++k) {
      float sum[4] = {0, 0, 0, 0};
#pragma unroll
      for (int c = 0; c < E::C; ++c)
#pragma unroll
        for (int q = 0; q < E::PPT; ++q) {
          const float v = m_.adjoint[E::row(c, q) * kRow + k];
#pragma unroll
          for (int j = 0; j < 4; ++j) sum[j] = fmaf(v, a[c][q][j], sum[j]);
        }
      add(net_.plan.last() + k * E::H, sum);
    }
    if (threadIdx.x < K) {
      float sum = 0;
      for (int p = 0; p < E::PT; ++p) sum += m_.adjoint[p * kRow + threadIdx.x];
      net_.gradient[net_.plan.last() + K * E::H + threadIdx.x] += sum;
    }
  }

  __device__ void first_layer_gradient(const Values& g) {
#pragma unroll
    for (int i = 0; i < 3; ++i) {
      float sum[4] = {0, 0, 0, 0};
#pragma unroll
      for (int q = 0; q < E::PPT; ++q)
#pragma unroll
        for (int j = 0; j < 4; ++j) {
          sum[j] = fmaf(g[0][q][j], m_.xi[i * E::R + E::point(q)], sum[j]);
          if (E::C >= 4) sum[j] = fmaf(g[E::C >= 4 ? i + 1 : 0][q][j], m_.scale[i], sum[j]);
        }
      add(i * E::H, sum);
    }
  }

  // Adds a sum over the tile's points to the gradient of a row of H narrow parameters.
  __device__ void add(int offset, float (&sum)[4]) {
#pragma unroll
    for (int j = 0; j < 4; ++j) {
      const float total = E::sum_points(sum[j]);
      if (E::point_lane() == 0) net_.gradient[offset + E::column(j)] += total;
    }
  }

  const TileNetwork& net_;
  Memory& m_;
  typename E::Stream& weights_;
  std::int64_t first_row_;
  Values z_;
};

}  // namespace granpinn::cuda::fused
