// Points through networks and back, one layer after another, in chunks that bound the memory.
//
//   forward    Z_l = A_{l-1} W_l^T + b_l (b_l: value rows alone),   A_l = f(Z_l)
//   backward   dL/dA_{l-1} = G_l W_l,   G_l = f'(Z_l)^T dL/dA_l
//              dL/dW_l = G_l^T A_{l-1},   dL/db_l = sum of the value rows of G_l
//
//   a panel    [members of a group][C channels][points of a chunk][width], in scratch memory:
//              the C * points rows of a member are the rows of one product with its weights
//
//   name      panel of                   kept
//   inputs    jets of coordinates, A_-1  through a chunk
//   z         pre-activations Z_l        all layers, for the way back
//   a         activations A_l            one layer, computed again on the way back
//   g, spare  adjoints                   of one layer; each product goes from one to the other
//   partial   [members][slices][size]    of one layer's gradient
//   gradient  [members][count] double    sums over all chunks
//
// The cuts of points into chunks, and of rows into slices of a gradient, do not depend on the
// number of members. So every member of an ensemble has the same bits as alone.
#pragma once

#include <algorithm>

#include "launch.h"
#include "launcher.cuh"

namespace granpinn::cuda {

// Members [first_member, first_member + members) at points [begin, begin + count).
struct Chunk {
  int channels;
  std::int64_t first_member, members, begin, count;
};

// The sizes of chunks and groups, and the positions of the panels in scratch memory.
template <class T>
struct Layout {
  int channels;                                                // largest number in any chunk
  std::int64_t points, members;                                // largest chunk, largest group
  std::size_t gradient, inputs, z, a, g, spare, partial, end;  // positions in bytes

  // longest: number of points of the largest set.
  Layout(const DeviceNetwork<T>& net, int channels, std::int64_t longest);

  // Calls work(chunk) for the chunks of `count` points.
  template <class Work>
  void for_chunks(std::int64_t first_member, std::int64_t group, int channels, std::int64_t count,
                  const Work& work) const {
    for (std::int64_t begin = 0; begin < count; begin += points)
      work(Chunk{channels, first_member, group, begin, std::min(points, count - begin)});
  }
};

template <class T>
class LayeredNetwork {
 public:
  LayeredNetwork(const DeviceNetwork<T>& net, const Layout<T>& layout, void* scratch, Launcher& run)
      : net_(net), layout_(layout), scratch_(static_cast<char*>(scratch)), run_(run) {}

  // Returns the raw outputs [members][C][count][outputs].
  const T* forward(const Chunk& chunk, const Batched<T>& points);

  // Memory for the adjoint of the raw outputs, in their layout: the input of backward.
  T* adjoint() const { return panel(layout_.g); }

  // After forward of the same chunk: adds its gradient of the parameters to the group's total.
  void backward(const Chunk& chunk);

  void clear_gradient(std::int64_t group);
  void store_gradient(std::int64_t first_member, std::int64_t group, T* grad_params);

 private:
  T* panel(std::size_t position) const { return reinterpret_cast<T*>(scratch_ + position); }
  double* total() const { return reinterpret_cast<double*>(scratch_ + layout_.gradient); }
  T* z(int layer) const;
  const T* weights(const Chunk& chunk, int layer) const;
  const T* layer_input(const Chunk& chunk, int layer);
  void layer_gradient(const Chunk& chunk, int layer, const T* input, const T* g);

  const DeviceNetwork<T>& net_;
  const Layout<T>& layout_;
  char* scratch_;
  Launcher& run_;
};

}  // namespace granpinn::cuda
