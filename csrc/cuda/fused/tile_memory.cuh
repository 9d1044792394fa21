// What a block of the tile kernel has at hand; E is an engine of products.
#pragma once

#include "mma_engine.cuh"
#include "simt_engine.cuh"

namespace granpinn::cuda::fused {

// Whether a thread has few values, and so registers for more besides: in small and medium tiles.
template <class E>
constexpr bool kFewValues = E::CP * E::PPT * E::neurons <= 32;

// Shared memory of a block.
template <class E>
struct TileMemory {
  float panel[E::R * E::ld];                 // operands of a product [row][neuron]
  float ring[E::warps * E::Stream::floats];  // weights
  alignas(16) float2 halves[E::exchange];    // sums on their way to other warps
  float xi[3 * E::R];                        // mapped coordinates [3][point]
  float observed[4 * E::R];                  // of the points: what the task needs
  float scale[4];
  float constants[kConstants];  // of the member: term weights, theta, physics
  unsigned peaks[2][kRow];      // of the operands, by channel; two take turns

  // With few values the panel starts with the first layer's weights and biases [4][H].
  // Between forward and backward the panel is free, first for the warps' parts of the outputs:
  __device__ float* raw() { return panel + E::warps * E::R * kRow; }  // outputs [row][K]
  __device__ float* adjoint() { return raw() + E::R * kRow; }         // their adjoints
  __device__ float* terms() { return adjoint() + E::R * kRow; }       // what points add to the sums
};

// What a block knows of its member's network.
struct TileNetwork {
  LaunchPlan plan;
  const float* narrow;  // weights of the first and last layer, biases
  float* stash;         // this block's
  void* activations;    // of this member: [L - 1][panel]
  void* adjoints;
  int* activation_scales;  // [L - 1][scales]
  int* adjoint_scales;
  float* gradient;  // of the narrow parameters, in shared memory
};

}  // namespace granpinn::cuda::fused
