// The seam between the torch side and the CUDA kernels: plain structs, and launchers that return
// the first error. All pointers are device pointers; no launcher allocates or waits for the device.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>

#include "problem.h"

namespace granpinn::cuda {

// A tensor of the ensemble: member e starts at data + e stride (stride 0: all share it).
template <class T>
struct Batched {
  const T* data;
  std::int64_t stride;

  GRANPINN_HD const T* member(std::int64_t e) const { return data + e * stride; }
};

// xi_i = (x_i - shift_i) scale_i, from tensors [3] or, where data is null, from the values.
template <class T>
struct InputMap {
  Batched<T> shift, scale;
  T shift_value[3], scale_value[3];

  GRANPINN_HD T shift_of(std::int64_t e, int i) const {
    return shift.data ? shift.member(e)[i] : shift_value[i];
  }
  GRANPINN_HD T scale_of(std::int64_t e, int i) const {
    return scale.data ? scale.member(e)[i] : scale_value[i];
  }
};

// Networks of the same widths.
template <class T>
struct DeviceNetwork {
  int layers;                           // affine maps
  std::int64_t widths[kMaxLayers + 1];  // 3, hidden ..., outputs
  std::int64_t members, count;          // of the ensemble; parameters of each
  const T* params;                      // [members, count]
  InputMap<T> input;

  GRANPINN_HD std::int64_t in(int layer) const { return widths[layer]; }
  GRANPINN_HD std::int64_t out(int layer) const { return widths[layer + 1]; }
  GRANPINN_HD std::int64_t outputs() const { return widths[layers]; }
  // position of W of a layer among the parameters; b follows it
  GRANPINN_HD std::int64_t offset(int layer) const {
    std::int64_t at = 0;
    for (int l = 0; l < layer; ++l) at += (in(l) + 1) * out(l);
    return at;
  }
};

// Most members of an ensemble whose laws differ: the names travel with the arguments of a launch.
constexpr int kMaxOwnLaws = 256;

// All arguments and results of residual_loss (granpinn/kernels/ops.py), for all members.
template <class T>
struct DeviceLoss {
  DeviceNetwork<T> net;
  Form form;
  std::int64_t n, m;               // interior and surface points
  LawName law;                     // of all members, unless
  bool own_laws;                   // each has its own
  std::uint8_t laws[kMaxOwnLaws];  // a LawName each
  int parameters;                  // the most that a law of a member has
  Batched<T> theta;                // [parameters]
  Batched<T> points;               // [n, 3]
  Batched<T> velocity;             // [n, 2]
  Batched<T> point_weights;        // [n, 2]
  Batched<T> source;               // [n, 2], or null
  Batched<T> surface_points;       // [m, 3]
  Batched<T> surface_pressure;     // [m]
  Batched<T> term_weights;         // [kTerms]
  Batched<T> physics;              // [kPhysics]
  T* loss;                         // [members]
  T* terms;                        // [members, kTerms]
  T* grad_params;                  // [members, count]
  T* grad_theta;                   // [members, parameters]
  bool drawn;  // draw_batch was the launch before; it does not change parameters

  GRANPINN_HD LawName law_of(std::int64_t e) const {
    return own_laws ? static_cast<LawName>(laws[e]) : law;
  }
};

// network_jet and its adjoint, for all members.
template <class T>
struct DeviceJet {
  DeviceNetwork<T> net;
  int channels;
  std::int64_t n;
  Batched<T> points;  // [n, 3]
  Batched<T> grad;    // [channels, n, outputs], of the adjoint
  T* out;             // [members, channels, n, outputs]
  T* grad_params;     // [members, count]
};

// Layer after layer, any width, depth and precision (layered_*.cu). The scratch memory has the size
// in bytes that *_scratch returns, and is aligned to 256.
template <class T>
std::size_t layered_loss_scratch(const DeviceLoss<T>& a);
template <class T>
cudaError_t layered_loss(const DeviceLoss<T>& a, void* scratch, cudaStream_t stream);

template <class T>
std::size_t layered_jet_scratch(const DeviceJet<T>& a);
template <class T>
cudaError_t layered_jet(const DeviceJet<T>& a, void* scratch, cudaStream_t stream);
template <class T>
cudaError_t layered_jet_adjoint(const DeviceJet<T>& a, void* scratch, cudaStream_t stream);

// eta [n], and its adjoint (problem.h).
template <class T>
cudaError_t viscosity_values(const ViscosityArguments<T>& a, cudaStream_t stream);
template <class T>
cudaError_t viscosity_gradient(const ViscosityArguments<T>& a, cudaStream_t stream);

// Residuals at points (problem.h).
template <class T>
cudaError_t residuals(const ResidualArguments<T>& a, cudaStream_t stream);

// out [count] at step *step of a run.
cudaError_t draw_indices(const std::int64_t* step, std::uint64_t seed, std::uint32_t stream_id,
                         std::int64_t count, std::uint64_t population, std::int64_t* out,
                         cudaStream_t stream);

}  // namespace granpinn::cuda
