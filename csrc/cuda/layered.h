// Points through networks and back, one layer after another, in chunks that bound the memory.
//
// Panels of a chunk lie in scratch memory, [members of a group][C][points][width]: the channels of
// a jet are rows of one matrix product with the weights. Pre-activations are kept for the way back,
// activations are recomputed there. How points are cut into chunks, and rows into slices of a
// gradient, does not depend on the number of members: an ensemble gives its members' own bits.
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

// How the work is cut, and where the panels are in scratch memory.
template <class T>
struct Layout {
  int channels;                  // the most of any chunk
  std::int64_t points, members;  // of a chunk and of a group, the most
  std::size_t gradient, inputs, z, a, g, spare, partial, end;  // positions in bytes

  // `longest`: the most points of any set; `extra`: bytes that the caller wants for each member.
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

  // Where backward expects the adjoint of the raw outputs, laid out like them.
  T* adjoint() const { return panel(layout_.g); }

  // After forward: adds the parameters' gradient of the chunk to the group's total.
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
