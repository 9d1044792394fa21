// A tile of 32 points through the network and back.
//
//   forward    z_0 = W_0 xi + b_0,   a_l = f(z_l),   z_l = W_l a_{l-1} + b_l  (b_l: values alone)
//   backward   dL/da_{l-1} = W_l^T g_l,   g_l = dL/dz_l = f'(z_l)^T dL/da_l
//              dL/dW_l = sum over channels and points of g_l a_{l-1}^T,   dL/db_l = sum of g_l
//
//                      32 points
//   channel value    +-----------+
//     neuron 0       |           |     a panel, [channel][neuron][32 points]: points fill vector
//     neuron 1       |           |     registers, and a channel of a layer is one product of gemm.h
//      ...           +-----------+     with the weights as they are
//   channel x        |    ...    |
//                    +-----------+
//
// A tile stays in cache. The backward pass reads the pre-activations z of all layers and computes
// the activations again. No memory grows with the number of points.
#pragma once

#include "gemm.h"
#include "kernel_table.h"
#include "math/jet.h"
#include "transpose.h"

namespace granpinn {
namespace GRANPINN_SIMD_NAMESPACE {

static_assert(kTile == kTilePoints, "panels are as wide as a tile");

template <class T>
struct TileBuffers {
  T* xi;       // [3][32] mapped coordinates
  T* z;        // [layer][C][out][32] pre-activations; the last layer: raw outputs
  T* a;        // [C][widest][32] activations; backward: adjoints, in turn with g
  T* g;        // [C][widest][32] backward: adjoints of one layer
  T* flipped;  // [in / 32][C][32 points][32 neurons] activations of one layer, transposed

  TileBuffers(const Network<T>& net, int C, T* memory) {
    std::ptrdiff_t stash = 0;
    for (int l = 0; l < net.layers; ++l) stash += net.out(l);
    const std::ptrdiff_t panel = static_cast<std::ptrdiff_t>(C) * kTile;
    xi = memory;
    z = xi + 3 * kTile;
    a = z + stash * panel;
    g = a + net.widest() * panel;
    flipped = g + net.widest() * panel;
  }
};

// Mapped coordinates of points [begin, end), at most 32. The last point fills the tile.
template <class T>
void load_points(const Network<T>& net, const T* points, std::int64_t begin, std::int64_t end,
                 T* xi) {
  for (int p = 0; p < kTile; ++p) {
    const T* x = points + 3 * (begin + p < end ? begin + p : end - 1);
    for (int i = 0; i < 3; ++i) xi[i * kTile + p] = (x[i] - net.shift[i]) * net.scale[i];
  }
}

// z of the first layer. The jet of coordinate i is (xi_i, scale_i e_i, 0).
template <int C, class T>
void first_layer(const Network<T>& net, const T* xi, T* z) {
  using V = Vec<T>;
  const std::ptrdiff_t H = net.out(0), panel = H * kTile;
  const T* W = net.params;
  const T* b = W + 3 * H;
  for (std::ptrdiff_t j = 0; j < H; ++j, W += 3)
    for (int p = 0; p < kTile; p += kLanes<T>) {
      T* at = z + j * kTile + p;
      V value(b[j]);
      for (int i = 0; i < 3; ++i) value += V(W[i]) * V::load(xi + i * kTile + p);
      value.store(at);
      for (int c = 1; c < C; ++c)
        V(c < 4 ? W[c - 1] * net.scale[c - 1] : T(0)).store(at + c * panel);
    }
}

// Fills tile.z from tile.xi. Returns its last layer, the raw outputs [C][outputs][32].
template <int C, class T>
const T* forward(const Network<T>& net, const TileBuffers<T>& tile) {
  using V = Vec<T>;
  first_layer<C>(net, tile.xi, tile.z);
  T* z = tile.z;
  for (int l = 1; l < net.layers; ++l) {
    const std::ptrdiff_t in = net.in(l), out = net.out(l), panel = in * kTile;
    for (std::ptrdiff_t e = 0; e < panel; e += kLanes<T>) {
      V zc[C], ac[C];
      for (int c = 0; c < C; ++c) zc[c] = V::load(z + c * panel + e);
      activation_jet<C>(zc, ac);
      for (int c = 0; c < C; ++c) ac[c].store(tile.a + c * panel + e);
    }
    z += C * panel;
    const T* W = net.params + net.offset(l);
    for (int c = 0; c < C; ++c) {
      const Product<T> g{W,
                         in,
                         1,
                         0,
                         tile.a + c * panel,
                         0,
                         static_cast<int>(in),
                         1,
                         z + c * out * kTile,
                         kTile,
                         c == 0 ? W + in * out : nullptr,
                         false};
      product(g, static_cast<int>(out));
    }
  }
  return z;
}

// Adds the gradient of the first layer's W and b.
template <int C, class T>
void first_layer_adjoint(const Network<T>& net, const T* xi, const T* g, T* gradient) {
  using V = Vec<T>;
  const std::ptrdiff_t H = net.out(0), panel = H * kTile, ld = padded(3);
  for (std::ptrdiff_t j = 0; j < H; ++j) {
    V w[3] = {V(T(0)), V(T(0)), V(T(0))}, b(T(0));
    for (int p = 0; p < kTile; p += kLanes<T>) {
      const T* at = g + j * kTile + p;
      const V value = V::load(at);
      b += value;
      for (int i = 0; i < 3; ++i) {
        w[i] += value * V::load(xi + i * kTile + p);
        if constexpr (C >= 4) w[i] += V(net.scale[i]) * V::load(at + (i + 1) * panel);
      }
    }
    for (int i = 0; i < 3; ++i) gradient[j * ld + i] += w[i].sum();
    gradient[H * ld + j] += b.sum();
  }
}

// Adds the gradient of the parameters, in the padded layout of gradient_offset.
// g_out: adjoint of the raw outputs [C][outputs][32]. tile.z: as `forward` left it.
template <int C, class T>
void backward(const Network<T>& net, const TileBuffers<T>& tile, const T* g_out, T* gradient) {
  using V = Vec<T>;
  const T* g = g_out;
  T* spare = tile.a;
  T* z = tile.z;
  for (int l = 0; l < net.layers - 1; ++l) z += C * net.out(l) * kTile;
  for (int l = net.layers - 1; l >= 1; --l) {
    const std::ptrdiff_t in = net.in(l), out = net.out(l), panel = in * kTile;
    const T* W = net.params + net.offset(l);
    z -= C * panel;
    // adjoint of the layer's input: W^T g, channel by channel
    for (int c = 0; c < C; ++c) {
      const Product<T> back{W,
                            1,
                            in,
                            0,
                            g + c * out * kTile,
                            0,
                            static_cast<int>(out),
                            1,
                            spare + c * panel,
                            kTile,
                            nullptr,
                            false};
      product(back, static_cast<int>(in));
    }
    // through the activation; also the activations, transposed, for the weights' gradient
    for (std::ptrdiff_t block = 0; block < padded(in) / kTile; ++block) {
      alignas(64) T activations[C][kTile][kTile];
      const std::ptrdiff_t rows = in - block * kTile < kTile ? in - block * kTile : kTile;
      for (std::ptrdiff_t e = 0; e < rows * kTile; e += kLanes<T>) {
        V zc[C], ac[C], gc[C];
        const std::ptrdiff_t at = block * kTile * kTile + e;
        for (int c = 0; c < C; ++c) zc[c] = V::load(z + c * panel + at);
        for (int c = 0; c < C; ++c) gc[c] = V::load(spare + c * panel + at);
        activation_jet_adjoint<C>(zc, ac, gc);
        for (int c = 0; c < C; ++c) ac[c].store(&activations[c][0][0] + e);
        for (int c = 0; c < C; ++c) gc[c].store(spare + c * panel + at);
      }
      for (int c = 0; c < C; ++c) {
        for (T* e = &activations[c][0][0] + rows * kTile;
             e < &activations[c][0][0] + kTile * kTile;)
          *e++ = T(0);
        transpose(&activations[c][0][0], tile.flipped + (block * C + c) * kTile * kTile);
      }
    }
    // weights: g a^T, summed over channels and points; biases: g of the value channel
    T* gW = gradient + gradient_offset(net, l);
    const std::ptrdiff_t ld = padded(in);
    for (std::ptrdiff_t block = 0; block < ld / kTile; ++block) {
      const Product<T> weights{g,
                               kTile,
                               1,
                               out * kTile,
                               tile.flipped + block * C * kTile * kTile,
                               kTile * kTile,
                               kTile,
                               C,
                               gW + block * kTile,
                               ld,
                               nullptr,
                               true};
      product(weights, static_cast<int>(out));
    }
    for (std::ptrdiff_t i = 0; i < out; ++i) {
      V sum(T(0));
      for (int p = 0; p < kTile; p += kLanes<T>) sum += V::load(g + i * kTile + p);
      gW[out * ld + i] += sum.sum();
    }
    T* done = l == net.layers - 1 ? tile.g : const_cast<T*>(g);
    g = spare;
    spare = done;
  }
  first_layer_adjoint<C>(net, tile.xi, g, gradient);
}

}  // namespace GRANPINN_SIMD_NAMESPACE
}  // namespace granpinn
