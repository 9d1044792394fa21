// Which tile a form takes: the engines of interior and surface points, by width and mode.
#pragma once

#include "layout.h"

namespace granpinn::cuda::fused {

// Points of a tile. A tensor-core tile of four points of the strong form has a channel of padding.
struct TileShape {
  int points, surface_points, rows;
};

constexpr TileShape tile_shape(Form form, bool tensor_cores, bool large) {
  if (form == Form::data) return large ? TileShape{64, 64, 64} : TileShape{32, 32, 32};
  if (form == Form::mixed) return large ? TileShape{16, 64, 64} : TileShape{8, 32, 32};
  if (large) return {8, 56, 56};
  return tensor_cores ? TileShape{4, 32, 32} : TileShape{4, 28, 28};
}

cudaError_t launch_data_tiles(const DeviceLoss<float>& a, const Plan& plan, const Scratch& scratch,
                              Chunk chunk, cudaStream_t stream);
cudaError_t launch_mixed_tiles(const DeviceLoss<float>& a, const Plan& plan, const Scratch& scratch,
                               Chunk chunk, cudaStream_t stream);
cudaError_t launch_strong_tiles(const DeviceLoss<float>& a, const Plan& plan,
                                const Scratch& scratch, Chunk chunk, cudaStream_t stream);

}  // namespace granpinn::cuda::fused
