// A tile of points through the network and back, by one block. E is an engine of products, L the
// number of hidden layers, f the activation of jets (math/jet.h).
//
//   forward    z_0 = W_0 xi + b_0,   a_l = f(z_l),   z_l = W_l a_{l-1} + b_l  (b_l: values alone)
//              raw = W_L a_{L-1} + b_L                                        (last_layer.cuh)
//   backward   dL/da_{L-1} = W_L^T adjoint
//              g_l = dL/dz_l = f'(z_l)^T dL/da_l,   dL/da_{l-1} = W_l^T g_l
//              dL/db_l = sum of g_l over the value rows,   dL/dW_0 = sum over the rows of g_0 xi^T
//
// dL/dW_l of the hidden layers, G^T A with A = a_{l-1} and G = g_l, is left to weights_kernel.cuh.
//
//                  slab 0     slab 1            H neurons; a slab of 32 for a warp, or for more
//               +----------+----------+-- ... --+
//   value       |          |          |         |  PT rows, one for each point
//   x           |          |          |         |  PT rows
//   y, t, ...   |          |          |         |  C channels, CP with padding: R = CP PT rows
//               +----------+----------+-- ... --+
//   value       |          |          |         |  2 PT rows in A and G alone, if E::more_rows:
//   again       |          |          |         |  for products of low pieces, see put
//               +----------+----------+-- ... --+
//
//   name            shape            where      layout
//   z, a, g         R x H            registers  Values: [channel][point of the thread][neuron]
//   operands        R x H            shared     memory.panel, one layer at a time; see E::put
//   pre-activations [L - 1][R][H]    global     stash: [layer - 1][row of a thread][thread][neuron]
//   A, G            [L - 1][.][H]    global     panels of the chunk; this tile from first_row on
//   raw, adjoint    R x K            shared     [row][kRow]
//   gradient        narrow()         shared     of W_0, W_L and all biases
//   peaks           2 x kRow         shared     of the operands in use; of the next ones, zero
//
// Pre-activations do not fit into registers: the way back loads them point by point, from L2.
#pragma once

#include "last_layer.cuh"
#include "math/jet.h"

namespace granpinn::cuda::fused {

// Outputs: the largest number K of outputs. Memory: TileMemory.
template <class E, int Outputs, class Memory>
class Tile {
 public:
  using Values = typename E::Values;

  __device__ Tile(const TileNetwork& net, Memory& memory, typename E::Stream& weights,
                  std::int64_t first_row)
      : net_(net), m_(memory), weights_(weights), first_row_(first_row) {}

  // Fills memory.raw(); stores the pre-activations.
  __device__ void forward() {
    Values z;
    const int L = net_.plan.hidden;
    for (int q = 0; q < E::PPT; ++q) {
      float zq[E::C][N];
      first_layer(kFewValues<E> ? m_.panel : net_.narrow, q, zq);
      set_point(zq, q, z);
    }
    for (int l = 0;; ++l) {
      if (l > 0) stash(l, z);
      activate(z);
      if (l == L - 1) break;
      put<true>(z, l, net_.activations, net_.activation_scales);
      float b[N];  // loaded while the product is computed
      E::load(net_.narrow + net_.plan.bias(l + 1), b);
      multiply<true>(z);
#pragma unroll
      for (int q = 0; q < E::PPT; ++q)
#pragma unroll
        for (int j = 0; j < N; ++j) z[q][j] += b[j];
    }
    Last(net_, m_).outputs(z);
  }

  // From memory.adjoint(): adds to the narrow gradients, and stores G for the hidden weights.
  __device__ void backward() {
    const int L = net_.plan.hidden;
    Values g;
    last_layer(g);
    for (int l = L - 1; l > 0; --l) {
      bias_gradient(l, g);
      put<false>(g, l - 1, net_.adjoints, net_.adjoint_scales);
      multiply<false>(g);
#pragma unroll
      for (int q = 0; q < E::PPT; ++q) {
        float zq[E::C][N];
        pre_activation(l - 1, q, zq);
#pragma unroll
        for (int j = 0; j < N; ++j) {
          float a[E::C];
          activate_adjoint(zq, q, j, a, g);
        }
      }
    }
    bias_gradient(0, g);
    first_layer_gradient(g);
  }

 private:
  using Last = LastLayer<E, Outputs, Memory>;
  static constexpr int N = E::neurons;

  __device__ static void set_point(const float (&zq)[E::C][N], int q, Values& z) {
#pragma unroll
    for (int c = 0; c < E::CP; ++c)
#pragma unroll
      for (int j = 0; j < N; ++j) z[c * E::PPT + q][j] = c < E::C ? zq[c < E::C ? c : 0][j] : 0;
  }

  // z of the first layer, of point q. The jet of coordinate i is (xi_i, scale_i e_i, 0).
  // weights: W and b [4][H], at the start of net.narrow or (TileMemory) of the panel.
  __device__ void first_layer(const float* weights, int q, float (&z)[E::C][N]) {
    float w[3][N], b[N];
#pragma unroll
    for (int i = 0; i < 3; ++i) E::load(weights + i * E::H, w[i]);
    E::load(weights + 3 * E::H, b);
#pragma unroll
    for (int j = 0; j < N; ++j) {
      float value = b[j];
#pragma unroll
      for (int i = 0; i < 3; ++i) value = fmaf(w[i][j], m_.xi[i * E::R + E::point(q)], value);
      z[0][j] = value;
#pragma unroll
      for (int c = 1; c < E::C; ++c)
        z[c][j] = c < 4 ? w[c < 4 ? c - 1 : 0][j] * m_.scale[c < 4 ? c - 1 : 0] : 0;
    }
  }

  // z of any layer, of point q: computed again for the first one, loaded for the others.
  __device__ void pre_activation(int layer, int q, float (&z)[E::C][N]) {
    if (layer == 0) return first_layer(net_.narrow, q, z);
    const float* from = stash_of(layer);
#pragma unroll
    for (int c = 0; c < E::C; ++c) E::copy(from + (c * E::PPT + q) * N * E::threads, z[c]);
  }

  __device__ static void activate(Values& z) {
#pragma unroll
    for (int q = 0; q < E::PPT; ++q)
#pragma unroll
      for (int j = 0; j < N; ++j) {
        float zc[E::C], ac[E::C];
#pragma unroll
        for (int c = 0; c < E::C; ++c) zc[c] = z[c * E::PPT + q][j];
        activation_jet<E::C>(zc, ac);
#pragma unroll
        for (int c = 0; c < E::C; ++c) z[c * E::PPT + q][j] = ac[c];
      }
  }

  // Neuron j of point q: a = f(z), and g becomes dL/dz instead of dL/da.
  __device__ static void activate_adjoint(const float (&z)[E::C][N], int q, int j, float (&a)[E::C],
                                          Values& g) {
    float zc[E::C], gc[E::C];
#pragma unroll
    for (int c = 0; c < E::C; ++c) zc[c] = z[c][j], gc[c] = g[c * E::PPT + q][j];
    activation_jet_adjoint<E::C>(zc, a, gc);
#pragma unroll
    for (int c = 0; c < E::C; ++c) g[c * E::PPT + q][j] = gc[c];
  }

  // Writes a to the shared panel for the next product, and to panel `layer` of the member in global
  // memory for the weights' gradient. The code is short: an instruction is fetched for one use.
  template <bool Forward>
  __device__ void put(const Values& a, int layer, void* panels, int* scales) {
    const LaunchPlan& plan = net_.plan;
    const int point0 = E::point(0);
    auto* to = static_cast<typename E::Element*>(panels) + layer * plan.panel() +
               (first_row_ + point0) * E::H;
    E::note_peaks(a, m_.peaks[turn_]);
    __syncthreads();
    float scale[E::CP];
#pragma unroll
    for (int c = 0; c < E::CP; ++c) scale[c] = E::scale_of(c, m_.peaks[turn_]);
    E::store_scales(scales + layer * plan.scales() + first_row_ / 4, plan.tile.panel_rows,
                    m_.peaks[turn_]);
#pragma unroll
    for (int c = 0; c < E::CP; ++c)
#pragma unroll
      for (int q = 0; q < E::PPT; ++q) {
        [[maybe_unused]] typename E::Stored v, rest;
        E::template put<Forward>(m_.panel, c, q, scale[c], a[c * E::PPT + q], v, rest);
        auto* row = to + (E::row(c, q) - point0) * E::H;
        E::store(row, v);
        if constexpr (E::more_rows)
          if (c == 0) {
            // The value channel's rows are (v, v, rest) in A and (v, rest, v) in G, so that
            // G^T A sums v v + rest v + v rest.
            E::store(row + E::R * E::H, Forward ? v : rest);
            E::store(row + (E::R + E::PT) * E::H, Forward ? rest : v);
          }
      }
    const typename E::Stored none = {};
#pragma unroll 1
    for (int r = (E::more_rows ? E::R + 2 * E::PT : E::R) + E::point_lane();
         r < plan.tile.panel_rows; r += 4)
      E::store(to + (r - point0) * E::H, none);
    if (threadIdx.x < kRow) m_.peaks[1 - turn_][threadIdx.x] = 0;
    __syncthreads();
  }

  template <bool Forward>
  __device__ void multiply(Values& z) {
    E::template multiply<Forward>(m_.panel, weights_, m_.halves, z);
    E::remove_scales(z, m_.peaks[turn_]);
    turn_ = 1 - turn_;
  }

  __device__ float* stash_of(int layer) {
    constexpr int values = E::CP * E::PPT * N;
    return net_.stash + (layer - 1) * values * E::threads + N * threadIdx.x;
  }
  __device__ void stash(int layer, const Values& z) {
    float* to = stash_of(layer);
#pragma unroll
    for (int i = 0; i < E::C * E::PPT; ++i) E::copy_to(to + i * N * E::threads, z[i]);
  }

  // The gradient of the last layer, and g = dL/dz of the last hidden layer.
  __device__ void last_layer(Values& g) {
    Last last(net_, m_);
    last.pull_back(g);
    typename Last::Sums sum = {};
#pragma unroll
    for (int q = 0; q < E::PPT; ++q) {
      float zq[E::C][N], aq[E::C][N];
      // makes the compiler load the adjoints again instead of keeping them in registers
      if constexpr (Last::few) asm volatile("" ::: "memory");
      pre_activation(net_.plan.hidden - 1, q, zq);
#pragma unroll
      for (int j = 0; j < N; ++j) {
        float a[E::C];
        activate_adjoint(zq, q, j, a, g);
        if constexpr (!Last::few) last.add_products(q, j, a, sum);
#pragma unroll
        for (int c = 0; c < E::C; ++c) aq[c][j] = a[c];
      }
      if constexpr (Last::few) last.add_products(q, aq, sum);
    }
#pragma unroll
    for (int k = 0; k < Outputs; ++k)
      if (k < net_.plan.outputs) add(net_.plan.last() + k * E::H, sum[k]);
    last.add_biases(net_.gradient + net_.plan.last() + net_.plan.outputs * E::H);
  }

  __device__ void bias_gradient(int layer, const Values& g) {
    float sum[N] = {};
#pragma unroll
    for (int i = 0; i < E::PPT * N; ++i) sum[i % N] += g[i / N][i % N];
    add(net_.plan.bias(layer), sum);
  }

  __device__ void first_layer_gradient(const Values& g) {
#pragma unroll
    for (int i = 0; i < 3; ++i) {
      float sum[N] = {};
#pragma unroll
      for (int q = 0; q < E::PPT; ++q)
#pragma unroll
        for (int j = 0; j < N; ++j) {
          sum[j] = fmaf(g[q][j], m_.xi[i * E::R + E::point(q)], sum[j]);
          if (E::C >= 4)
            sum[j] = fmaf(g[(E::C >= 4 ? i + 1 : 0) * E::PPT + q][j], m_.scale[i], sum[j]);
        }
      add(i * E::H, sum);
    }
  }

  // Adds a sum over the tile's points to the gradient of a row of H narrow parameters.
  __device__ void add(int offset, const float (&sum)[N]) {
    const float total = E::sum_points(sum);
    if (E::point_lane() < N) net_.gradient[offset + E::column() + E::point_lane()] += total;
  }

  const TileNetwork& net_;
  Memory& m_;
  typename E::Stream& weights_;
  std::int64_t first_row_;
  int turn_ = 0;  // buffer of peaks in use
};

}  // namespace granpinn::cuda::fused
