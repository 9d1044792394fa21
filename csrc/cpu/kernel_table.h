// The seam between the torch side and the vectorised kernels: function pointers.
//
// kernels.cpp is compiled once per instruction set and fills one table each; dispatch.cpp picks
// the table that the processor can run. Nothing here depends on the instruction set.
#pragma once

#include "problem.h"

namespace granpinn {

constexpr std::int64_t kTilePoints = 32;  // points that go through the network together

GRANPINN_HD std::int64_t padded(std::int64_t width) {
  return (width + kTilePoints - 1) / kTilePoints * kTilePoints;
}

// The gradient of a thread: the layout of the parameters, with rows of W padded to whole tiles.
template <class T>
GRANPINN_HD std::int64_t gradient_offset(const Network<T>& net, int layer) {
  std::int64_t at = 0;
  for (int l = 0; l < layer; ++l) at += (padded(net.in(l)) + 1) * net.out(l);
  return at;
}

// Scalars of scratch memory of a thread; the size does not depend on the number of points.
template <class T>
GRANPINN_HD std::int64_t workspace_size(const Network<T>& net, int channels) {
  std::int64_t stash = 0;
  for (int l = 0; l < net.layers; ++l) stash += net.out(l);
  const std::int64_t panels = stash + 2 * net.widest() + padded(net.widest());
  return panels * channels * kTilePoints + 3 * kTilePoints;
}

// The gradient that one thread adds up. Blocks of tiles are summed in T, the blocks in double: the
// rounding error does not grow with the number of points.
template <class T>
struct GradientSum {
  static constexpr int kBlock = 32;  // tiles

  T* block;           // padded layout, zero at the start
  double* total;      // padded layout; set by the first flush
  std::int64_t size;  // of either
  int tiles = 0;      // in the block
  bool flushed = false;

  GRANPINN_HD void tile_done() {
    if (++tiles == kBlock) flush();
  }
  GRANPINN_HD void flush() {
    for (std::int64_t i = 0; i < size; ++i) {
      total[i] = (flushed ? total[i] : 0.0) + static_cast<double>(block[i]);
      block[i] = T(0);
    }
    tiles = 0;
    flushed = true;
  }
};

// The sums of the loss over the tiles of one thread.
template <class T>
struct LossSums {
  GradientSum<T> gradient;
  double squares[kTerms] = {};  // sums of weighted squared residuals
  double theta[kMaxLawParameters] = {};
};

template <class T>
struct KernelTable {
  const char* name;
  // Points [begin, end) through the network: out [channels, n, outputs].
  void (*jet)(const Network<T>&, int channels, const T* points, std::int64_t begin,
              std::int64_t end, std::int64_t n, T* out, T* workspace);
  // Adds the parameters' gradient of sum(grad_out * jet).
  void (*jet_adjoint)(const Network<T>&, int channels, const T* points, std::int64_t begin,
                      std::int64_t end, std::int64_t n, const T* grad_out, GradientSum<T>* gradient,
                      T* workspace);
  // Tiles [begin, end) of the loss; interior tiles first, then surface tiles.
  void (*loss)(const LossArguments<T>&, std::int64_t begin, std::int64_t end, LossSums<T>* sums,
               T* workspace);
  // Residuals, eta, and the adjoint of eta (problem.h).
  void (*residuals)(const ResidualArguments<T>&);
  void (*viscosity)(const ViscosityArguments<T>&);
  void (*viscosity_adjoint)(const ViscosityArguments<T>&);
  // The orthogonal factor of G [m, n], roughly; orthogonalize.h describes it and the workspace.
  void (*orthogonalize)(const T* G, std::int64_t m, std::int64_t n, T* out, T* workspace);
};

// The table for this processor; GRANPINN_CPU=generic|avx2|avx512 in the environment lowers it.
template <class T>
const KernelTable<T>& kernels();

}  // namespace granpinn
