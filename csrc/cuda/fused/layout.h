// The fused path of residual_loss on a GPU: shapes and the layout of its scratch memory.
//
// Layers are padded to one width H (zeros change nothing: swish(0) = 0). A block of H threads takes
// a tile of points through the network and back. Its warp w owns the neurons 32 w .. 32 w + 31 of
// every layer, for all rows of the tile; a row is one channel of one point.
//   pack      brings the weights into the order in which the warps stream them;
//   tile      forward, physics, backward; leaves activations A and adjoints G of all rows;
//   weights   gradient G^T A of the hidden weights, split over the rows;
//   collect   adds up what the blocks left, in fixed order and in double.
#pragma once

#include "../launch.h"

namespace granpinn::cuda::fused {

constexpr int kWidest = 256;
constexpr int kSlab = 32;                // neurons of a warp
constexpr int kBlockK = 8;               // inputs in a stage of the weight stream
constexpr int kStage = kSlab * kBlockK;  // floats of a stage
constexpr int kRow = 8;                  // outputs of a row, padded
constexpr int kSums = 8;                 // squares of the five terms, then theta

// How a problem is cut up. Everything follows from its shape and the number of multiprocessors.
struct Plan {
  int H;               // padded width
  int hidden;          // hidden layers L
  int outputs;         // K
  bool tensor_cores;   // products on tensor cores
  bool large;          // the larger of two tiles
  int points;          // interior points of a tile
  int surface_points;  // surface points of a tile
  int rows;            // of either
  int interior_tiles;  // of a member
  int tiles;           // with those of the surface
  int slots;           // blocks of a member
  int chunk;           // tiles of a member that go through the kernels together
  int splits;          // of the rows of a chunk, in the weights kernel
  bool shared_stash;   // pre-activations are kept in shared memory

  // products that stream weights: forward through layers 1 .. L-1, then backward
  GRANPINN_HD int products() const { return 2 * (hidden - 1); }
  // first layer [3][H], biases [L][H], last layer [K][H], its biases [kRow]
  GRANPINN_HD int narrow() const { return (3 + hidden + outputs) * H + kRow; }
  GRANPINN_HD int bias(int layer) const { return (3 + layer) * H; }
  GRANPINN_HD int last() const { return (3 + hidden) * H; }
  // pre-activations that a block keeps for the way back: of all layers but the first and the last
  GRANPINN_HD int stash() const { return (hidden > 2 ? hidden - 2 : 0) * rows * H; }
  GRANPINN_HD std::int64_t packed() const { return std::int64_t(products()) * H * H; }
  GRANPINN_HD std::int64_t panel() const { return std::int64_t(chunk) * rows * H; }
};

struct Scratch {
  float* packed;            // [E][products][H * H] hidden weights, as streamed
  float* narrow;            // [E][narrow] first and last layer, biases
  float* stash;             // [E * slots][L - 2][values of a thread][H] pre-activations
  float* activations;       // A [E][L - 1][panel]
  float* adjoints;          // G likewise
  float* gradients;         // [E][L - 1][splits][H * H]
  float* narrow_gradients;  // [E][slots][narrow]
  double* sums;             // [E][slots][kSums]
};

// Tiles [begin, begin + count) of every member go through one launch of tile and weights.
struct Chunk {
  int begin, count;
};

}  // namespace granpinn::cuda::fused
