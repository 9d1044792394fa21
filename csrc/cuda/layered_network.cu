// The launches of layered.h, which has the equations and the panels.
#include "gemm.cuh"
#include "layered.h"
#include "layers.cuh"

namespace granpinn::cuda {

namespace {

// Rows of a slice: a gradient sums these in T. Slices and chunks are added in double, so that the
// rounding error does not grow with the number of points.
constexpr int kSliceRows = 512;

constexpr std::int64_t kMostPoints = 16384, kFewestPoints = 256;          // of a chunk
constexpr std::int64_t kMemberBytes = 128ll << 20, kBytes = 256ll << 20;  // of scratch memory
constexpr std::int64_t kMostBlocks = 65535;                               // of a grid in y, z

std::int64_t slices_of(std::int64_t rows) { return (rows + kSliceRows - 1) / kSliceRows; }

std::size_t aligned(std::size_t bytes) { return (bytes + 255) / 256 * 256; }

// Scratch memory of a member, in scalars.
struct Sizes {
  std::int64_t stash = 0, hidden = 1, widest = 1, layer = 0;  // layer: parameters of the largest

  template <class T>
  explicit Sizes(const DeviceNetwork<T>& net) {
    for (int l = 0; l < net.layers; ++l) {
      stash += net.out(l);
      widest = std::max(widest, net.out(l));
      if (l > 0) hidden = std::max(hidden, net.in(l));
      layer = std::max(layer, (net.in(l) + 1) * net.out(l));
    }
  }

  std::int64_t of_chunk(std::int64_t rows) const {
    return rows * (3 + stash + hidden + 2 * widest) + slices_of(rows) * layer;
  }
};

template <class Work>
void for_channels(int channels, const Work& work) {
  if (channels == 1) work(std::integral_constant<int, 1>());
  if (channels == 4) work(std::integral_constant<int, 4>());
  if (channels == 7) work(std::integral_constant<int, 7>());
}

dim3 grid_of(std::int64_t size, std::int64_t members) {
  return dim3(blocks_of(size, kThreads), static_cast<unsigned>(members));
}

}  // namespace

template <class T>
Layout<T>::Layout(const DeviceNetwork<T>& net, int channels_, std::int64_t longest)
    : channels(channels_) {
  const Sizes sizes(net);
  constexpr std::int64_t bytes = sizeof(T);
  points = kMostPoints;
  while (points > kFewestPoints && bytes * sizes.of_chunk(channels * points) > kMemberBytes)
    points /= 2;
  const std::int64_t chunks = std::max<std::int64_t>(1, (longest + points - 1) / points);
  points = (longest + chunks - 1) / chunks;  // chunks of equal length
  const std::int64_t rows = channels * points, slices = std::max<std::int64_t>(1, slices_of(rows));
  const std::int64_t member = bytes * sizes.of_chunk(rows) + 8 * net.count;
  members = std::min({net.members, kBytes / member, kMostBlocks / slices});
  members = std::max<std::int64_t>(1, members);
  end = 0;
  const auto place = [&](std::int64_t count, std::size_t size) {
    const std::size_t position = end;
    end += aligned(static_cast<std::size_t>(members * count) * size);
    return position;
  };
  gradient = place(net.count, sizeof(double));
  inputs = place(3 * rows, sizeof(T));
  z = place(sizes.stash * rows, sizeof(T));
  a = place(sizes.hidden * rows, sizeof(T));
  g = place(sizes.widest * rows, sizeof(T));
  spare = place(sizes.widest * rows, sizeof(T));
  partial = place(slices * sizes.layer, sizeof(T));
}

template <class T>
T* LayeredNetwork<T>::z(int layer) const {
  std::int64_t before = 0;
  for (int l = 0; l < layer; ++l) before += net_.out(l);
  return panel(layout_.z) + before * layout_.members * layout_.channels * layout_.points;
}

template <class T>
const T* LayeredNetwork<T>::weights(const Chunk& chunk, int layer) const {
  return net_.params + chunk.first_member * net_.count + net_.offset(layer);
}

// The input of a layer, [members][C][count][in].
template <class T>
const T* LayeredNetwork<T>::layer_input(const Chunk& chunk, int layer) {
  if (layer == 0) return panel(layout_.inputs);
  T* a = panel(layout_.a);
  const std::int64_t size = chunk.count * net_.in(layer);
  for_channels(chunk.channels, [&](auto C) {
    run_(activate<C, T>, grid_of(size, chunk.members), dim3(kThreads), z(layer - 1), a, size);
  });
  return a;
}

template <class T>
const T* LayeredNetwork<T>::forward(const Chunk& chunk, const Batched<T>& points) {
  for_channels(chunk.channels, [&](auto C) {
    run_(input_panel<C, T>, grid_of(3 * chunk.count, chunk.members), dim3(kThreads), net_.input,
         points, chunk.first_member, chunk.begin, chunk.count, panel(layout_.inputs));
  });
  const std::int64_t rows = chunk.channels * chunk.count;
  for (int l = 0; l < net_.layers; ++l) {
    const std::int64_t in = net_.in(l), out = net_.out(l);
    const T* W = weights(chunk, l);
    // Z = A W^T + b; b for the value rows alone
    Product<T> p{};
    p.a = layer_input(chunk, l);
    p.a_stride = in;
    p.a_batch = rows * in;
    p.b = W;
    p.b_stride = in;
    p.b_batch = net_.count;
    p.out = z(l);
    p.out_batch = rows * out;
    p.bias = W + in * out;
    p.bias_batch = net_.count;
    p.bias_rows = static_cast<int>(chunk.count);
    p.M = static_cast<int>(rows);
    p.N = static_cast<int>(out);
    p.K = p.slice = static_cast<int>(in);
    p.slices = 1;
    product<true, true, sizeof(T) == 4 ? 8 : 4>(run_, p, chunk.members);
  }
  return z(net_.layers - 1);
}

// Adds the gradient of a layer's W and b. input: A of the layer before; g: adjoint of its own Z.
template <class T>
void LayeredNetwork<T>::layer_gradient(const Chunk& chunk, int layer, const T* input, const T* g) {
  const std::int64_t in = net_.in(layer), out = net_.out(layer), size = (in + 1) * out;
  const std::int64_t rows = chunk.channels * chunk.count;
  const int slices = static_cast<int>(slices_of(rows));
  T* partial = panel(layout_.partial);
  // G^T A, summed over channels and points
  Product<T> p{};
  p.a = g;
  p.a_stride = out;
  p.a_batch = rows * out;
  p.b = input;
  p.b_stride = in;
  p.b_batch = rows * in;
  p.out = partial;
  p.out_batch = size;
  p.M = static_cast<int>(out);
  p.N = static_cast<int>(in);
  p.K = static_cast<int>(rows);
  p.slices = slices;
  p.slice = kSliceRows;
  product<false, false, 4>(run_, p, chunk.members);
  const dim3 grid(blocks_of(out, kColumns), 1, static_cast<unsigned>(chunk.members * slices));
  run_(column_sums<T>, grid, dim3(kColumns, kLanes), g, rows * out, static_cast<int>(chunk.count),
       static_cast<int>(out), slices, kSliceRows, partial + in * out, size);
  run_(add_partials<T>, grid_of(size, chunk.members), dim3(kThreads), partial, slices, size,
       total() + net_.offset(layer), net_.count);
}

template <class T>
void LayeredNetwork<T>::backward(const Chunk& chunk) {
  const std::int64_t rows = chunk.channels * chunk.count;
  T *g = panel(layout_.g), *spare = panel(layout_.spare), *a = panel(layout_.a);
  for (int l = net_.layers - 1; l >= 1; --l) {
    const std::int64_t in = net_.in(l), out = net_.out(l);
    // adjoint of the layer's input: G W
    Product<T> p{};
    p.a = g;
    p.a_stride = out;
    p.a_batch = rows * out;
    p.b = weights(chunk, l);
    p.b_stride = in;
    p.b_batch = net_.count;
    p.out = spare;
    p.out_batch = rows * in;
    p.M = static_cast<int>(rows);
    p.N = static_cast<int>(in);
    p.K = p.slice = static_cast<int>(out);
    p.slices = 1;
    product<true, false, sizeof(T) == 4 ? 8 : 4>(run_, p, chunk.members);
    const std::int64_t size = chunk.count * in;
    for_channels(chunk.channels, [&](auto C) {
      run_(activate_adjoint<C, T>, grid_of(size, chunk.members), dim3(kThreads), z(l - 1), a, spare,
           size);
    });
    layer_gradient(chunk, l, a, g);
    std::swap(g, spare);
  }
  layer_gradient(chunk, 0, panel(layout_.inputs), g);
}

template <class T>
void LayeredNetwork<T>::clear_gradient(std::int64_t group) {
  run_.zero(total(), static_cast<std::size_t>(group * net_.count) * sizeof(double));
}

template <class T>
void LayeredNetwork<T>::store_gradient(std::int64_t first_member, std::int64_t group,
                                       T* grad_params) {
  const std::int64_t size = group * net_.count;
  run_(round_total<T>, grid_of(size, 1), dim3(kThreads), total(), size,
       grad_params + first_member * net_.count);
}

template struct Layout<float>;
template struct Layout<double>;
template class LayeredNetwork<float>;
template class LayeredNetwork<double>;

}  // namespace granpinn::cuda
