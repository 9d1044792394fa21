// The fused path of residual_loss on a GPU: shapes and the layout of its scratch memory.
//
// Layers are padded to one width H (zeros change nothing: swish(0) = 0). A block takes a tile of
// points through the network and back. Its warps own slabs of 32 neurons of every layer, for all
// rows of the tile; a row is one channel of one point. Where a multiprocessor has one tile only, on
// tensor cores two warps share a slab: each sums over half of the inputs, then they halve the
// neurons. In float32, four warps then share their four slabs: each sums over a quarter of the
// inputs, with more registers and so fewer loads for a product.
//   pack      brings the weights into the order in which the warps stream them;
//   tile      forward, physics, backward; stores activations A and adjoints G of all rows (on
//             tensor cores the half-precision operands of its products);
//   weights   gradient G^T A of the hidden weights, split over the rows;
//   collect   adds up the results of the blocks, in fixed order and in double.
#pragma once

#include "../launch.h"

namespace granpinn::cuda::fused {

constexpr int kWidest = 256;
constexpr int kDeepest = 8;  // hidden layers
constexpr int kSlab = 32;    // neurons of a warp, or of the two that share them
constexpr int kRow = 8;      // outputs of a row, padded

constexpr int kConstants = kSums + kPhysics;  // of a member: term weights, theta, physics

// How a tile is cut. Tensor cores take rows by eights: a tile of four points of the strong form has
// a channel of padding.
struct TileShape {
  int points, surface_points;  // of a tile of either kind
  int rows;                    // of an interior tile, in shared memory
  int panel_rows;              // of either, in the panels of the weights kernel
  int split;                   // warps of a slab
  int parts;                   // of a product's inputs, in float32, one for each warp
  int stage, stages;           // floats of a stage of weights, stages in a warp's ring
  int blocks;                  // that share a multiprocessor, by registers
  bool kept;                   // whether the cache (L2) keeps the panels for the weights kernel
};

// Large tiles load fewer weights per point; small ones give every multiprocessor some work.
enum class Size { small, medium, large };

// Near convergence the parts of the gradient cancel, most of all in the value channel. There ten
// bits of mantissa cause three times the error of float32. So both products of the backward pass
// take this channel in two pieces. In the panels, the products of the pieces are rows of their own,
// except at the few surface points.
constexpr bool compensated(bool tensor_cores) { return tensor_cores; }

// The backward pass also takes the weights and all channels in two pieces (an exception for large
// tiles: MmaEngine::fine_inputs). The rounding of a weight is the same at all points and does not
// average out. In the strong form one piece is enough: second derivatives raise its float32 error.
constexpr bool fine_weights(Form form, bool tensor_cores) {
  return tensor_cores && form != Form::strong;
}

// Panels of medium tiles take about half of the cache. Those of large tiles do not fit into it, and
// those of small ones always do: both are marked as the first to leave it.
//
// A thread has 128 registers; 255 in the small tiles of float32; 168 in the mixed form's medium
// tiles: three of them share a multiprocessor, with a longer ring. With more stages for its large
// tiles, wide layers would lose their second block.
constexpr TileShape tile_shape(Form form, bool tensor_cores, Size size, int H) {
  const bool large = size == Size::large, small = size == Size::small;
  const int channels = form == Form::strong ? 7 : form == Form::mixed ? 4 : 1;
  TileShape t{};
  t.points = large ? 8 : 4;
  if (form == Form::mixed && !small) t.points = large ? 16 : 8;
  if (form == Form::data) t.points = large ? 64 : small ? 8 : 32;
  t.rows = channels * t.points;
  if (tensor_cores) t.rows = (t.rows + 7) / 8 * 8;
  t.surface_points = t.panel_rows = t.rows;
  if (compensated(tensor_cores)) {
    t.panel_rows = t.rows + 2 * t.points;
    if (form == Form::data) t.surface_points = t.panel_rows / 3;
  }
  t.split = small && tensor_cores ? 2 : 1;
  t.parts = small && !tensor_cores ? 4 : 1;
  t.stage = t.parts > 1 ? 1024 : 512;
  t.stages = t.split > 1 ? 4 : t.parts > 1 ? 3 : 2;
  t.blocks = (t.parts > 1 ? 256 : 512) / (H * t.split);
  t.kept = size == Size::medium;
  if (!small && tensor_cores && form == Form::mixed && H == 128) {
    t.stages = large ? 3 : 6;
    if (!large) t.blocks = 3;
  }
  return t;
}

// A row of the panel in shared memory, in floats: rows are eight banks apart.
constexpr int row_floats(int H) { return H + 8; }

// Of TileMemory (tile_memory.cuh).
constexpr int tile_floats(TileShape tile, int H) {
  const int ring = tile.split * H / kSlab * tile.stages * tile.stage;
  const int halves =
      tile.split * tile.parts == 1 ? 4 : (tile.split * tile.parts - 1) * tile.rows * H;
  const int floats =
      tile.rows * row_floats(H) + ring + halves + 7 * tile.rows + 4 + kConstants + 2 * kRow;
  return (floats + 3) / 4 * 4;  // the struct is aligned to 16 bytes
}

// The sizes of a launch. They follow from the shape of the problem and the GPU.
struct LaunchPlan {
  int H;                      // padded width
  int hidden;                 // hidden layers L
  int outputs;                // K
  int offsets[kDeepest + 1];  // of the layers in a member's parameters
  bool tensor_cores;          // products on tensor cores
  bool fine_weights;          // see above
  Size size;                  // of the tiles
  TileShape tile;
  int interior_tiles;  // of a member
  int tiles;           // interior and surface tiles
  int slots;           // blocks of a member
  int chunk;           // tiles of a member that go through the kernels together

  // weights kernel
  int weights_rows;    // of a tile of weights: 64, 128 or 256
  int weights_stages;  // of its ring
  int splits;          // of the rows of a chunk

  // products that stream weights: forward through layers 1 .. L-1, then backward
  GRANPINN_HD int products() const { return 2 * (hidden - 1); }
  // first layer [3][H], biases [L][H], last layer [K][H], its biases [kRow]
  GRANPINN_HD int narrow() const { return (3 + hidden + outputs) * H + kRow; }
  GRANPINN_HD int bias(int layer) const { return (3 + layer) * H; }
  GRANPINN_HD int last() const { return (3 + hidden) * H; }
  // pre-activations that a block keeps for the backward pass: of all layers but the first
  GRANPINN_HD int stash() const { return (hidden - 1) * tile.rows * H; }
  // streamed weights: float32, or two halves forward and one or two backward
  GRANPINN_HD std::int64_t packed() const {
    return std::int64_t(hidden - 1) * H * H * (tensor_cores && !fine_weights ? 3 : 4) / 2;
  }
  GRANPINN_HD std::int64_t stream() const { return packed() / (H / kSlab * tile.split); }
  int tile_bytes() const { return 4 * (tile_floats(tile, H) + narrow()); }
  GRANPINN_HD std::int64_t panel() const { return std::int64_t(chunk) * tile.panel_rows * H; }
  // halves on tensor cores, and an exponent of their scale for every four rows
  std::int64_t panel_bytes() const { return panel() * (tensor_cores ? 2 : 4); }
  GRANPINN_HD std::int64_t scales() const { return std::int64_t(chunk) * tile.panel_rows / 4; }
};

// Position of a narrow parameter (LaunchPlan::narrow) among the network's, -1 for padding.
template <int H>
GRANPINN_HD int narrow_position(const DeviceNetwork<float>& net, const LaunchPlan& plan, int i) {
  const int row = i / H, n = i % H, L = plan.hidden, K = plan.outputs;
  if (row < 3) return n < net.out(0) ? 3 * n + row : -1;
  const int layer = row < 3 + L ? row - 3 : L;
  const int in = static_cast<int>(net.in(layer)), out = static_cast<int>(net.out(layer));
  const int at = plan.offsets[layer];
  if (row < 3 + L || row == 3 + L + K) return n < out ? at + in * out + n : -1;
  return n < in ? at + (row - 3 - L) * in + n : -1;
}

struct Scratch {
  float* packed;            // [E][packed] hidden weights, as streamed
  float* narrow;            // [E][narrow] first and last layer, biases
  float* stash;             // [E * slots][L - 1][values of a thread][threads] pre-activations
  void* activations;        // A [E][L - 1][panel]
  void* adjoints;           // G [E][L - 1][panel]
  int* activation_scales;   // [E][L - 1][scales], see MmaEngine::store_scales
  int* adjoint_scales;      // [E][L - 1][scales] of the adjoints
  float* gradients;         // [E][L - 1][splits][H * H]
  float* narrow_gradients;  // [E][slots][narrow]
  double* sums;             // [E][slots][kSums]
};

// Tiles [begin, begin + count) of every member go through one launch of tile and weights.
struct Chunk {
  int begin, count;
};

}  // namespace granpinn::cuda::fused
