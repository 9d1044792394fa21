// Shared memory of a block of the tile kernel, and the addresses of its member's network.
//
// E is an engine of products (MmaEngine or SimtEngine): E::R rows, E::ld floats from row to row.
//
//   panel while a layer is computed      [R][ld]            operands of a product
//   panel between forward and backward   [warps][R][kRow]   the warps' parts of the outputs
//                                        [R][kRow]          raw(): outputs
//                                        [R][kRow]          adjoint(): adjoints of the outputs
//                                        [kSums][R]         terms(): loss terms of the points
//   panel at the start, few values       [4][H]             W and b of the first layer
#pragma once

#include "mma_engine.cuh"
#include "simt_engine.cuh"

namespace granpinn::cuda::fused {

// Whether a thread has few values (small and medium tiles). It then has registers to spare.
template <class E>
constexpr bool kFewValues = E::CP * E::PPT * E::neurons <= 32;

// Shared memory of a block.
template <class E>
struct TileMemory {
  float panel[E::R * E::ld];                 // see above
  float ring[E::warps * E::Stream::floats];  // weights, one ring for each warp
  alignas(16) float2 halves[E::exchange];    // sums that warps of a slab exchange
  float xi[3 * E::R];                        // mapped coordinates [3][point]
  float observed[4 * E::R];                  // observations [point][4], see tasks.cuh
  float scale[4];                            // of the input map, per axis
  float constants[kConstants];               // of the member: term weights, theta, physics
  unsigned peaks[2][kRow];  // largest |operand| of each channel, as bits; two buffers alternate

  __device__ float* raw() { return panel + E::warps * E::R * kRow; }
  __device__ float* adjoint() { return raw() + E::R * kRow; }
  __device__ float* terms() { return adjoint() + E::R * kRow; }
};

// The network of a block's member.
struct TileNetwork {
  LaunchPlan plan;
  const float* narrow;     // global: weights of the first and last layer, biases
  float* stash;            // global, of this block: pre-activations
  void* activations;       // global, of this member: A [L - 1][panel]
  void* adjoints;          // global, of this member: G [L - 1][panel]
  int* activation_scales;  // global: [L - 1][scales]
  int* adjoint_scales;     // global: [L - 1][scales]
  float* gradient;         // shared: gradient of the narrow parameters
};

}  // namespace granpinn::cuda::fused
