// The problem in plain structs, which the torch side passes to the kernels of any device.
#pragma once

#include <cstdint>

#include "math/laws/laws.h"
#include "math/physics.h"
#include "math/terms.h"

namespace granpinn {

enum class Form { data, mixed, strong };

// Channels of the network's jet that a form reads at interior points.
GRANPINN_HD constexpr int channels_of(Form form) {
  return form == Form::data ? 1 : form == Form::mixed ? 4 : 7;
}

// Residuals of the equations at a point.
GRANPINN_HD constexpr int residuals_of_form(Form form) {
  return form == Form::data ? 0 : form == Form::mixed ? 5 : 3;
}

// The sums that a pass over the points leaves: squares of the terms, then the gradient by theta.
constexpr int kSums = kTerms + kMaxLawParameters;

constexpr int kMaxLayers = 64;  // affine maps of a network

template <class T>
struct Network {
  const std::int64_t* widths;  // [layers + 1]: 3, hidden ..., outputs
  int layers;                  // affine maps
  const T* params;             // per layer W [out, in] row-major, then b [out]
  T shift[3], scale[3];        // xi_i = (x_i - shift_i) scale_i

  GRANPINN_HD std::int64_t in(int layer) const { return widths[layer]; }
  GRANPINN_HD std::int64_t out(int layer) const { return widths[layer + 1]; }
  GRANPINN_HD std::int64_t outputs() const { return widths[layers]; }
  // position of W of a layer in the flat parameter vector; b follows it
  GRANPINN_HD std::int64_t offset(int layer) const {
    std::int64_t at = 0;
    for (int l = 0; l < layer; ++l) at += (in(l) + 1) * out(l);
    return at;
  }
  GRANPINN_HD std::int64_t widest() const {
    std::int64_t most = 1;
    for (int l = 1; l <= layers; ++l) most = widths[l] > most ? widths[l] : most;
    return most;
  }
};

template <class T>
struct LossArguments {
  Network<T> net;
  Form form;
  Physics<T> physics;
  LawName law;
  T theta[kMaxLawParameters];
  T term_weights[kTerms];
  std::int64_t n, m;          // interior and surface points
  const T* points;            // [n, 3]
  const T* velocity;          // [n, 2]
  const T* point_weights;     // [n, 2]
  const T* source;            // [n, 2], or null
  const T* surface_points;    // [m, 3]
  const T* surface_pressure;  // [m]
};

// The viscosity at n points: eta; or, from `grad`, the adjoint of eta, the adjoints of gamma_dot, p
// and theta at each point.
template <class T>
struct ViscosityArguments {
  Physics<T> physics;
  LawName law;
  const T* theta;  // [parameters of the law]
  std::int64_t n;
  const T *gamma_dot, *p, *grad;            // [n]
  T* eta;                                   // [n]
  T *grad_gamma_dot, *grad_p, *grad_theta;  // [n], [n], [n, parameters of the law]
};

// The residuals of a form at n points, from raw jets of the network.
template <class T>
struct ResidualArguments {
  Form form;
  bool softplus;  // map of the pressure: softplus for the network of the mixed form, else linear
  Physics<T> physics;
  LawName law;
  const T* theta;  // [parameters of the law]
  std::int64_t n, fields;
  const T* jets;  // [channels, n, fields]
  T* out;         // [n, residuals]
};

}  // namespace granpinn
