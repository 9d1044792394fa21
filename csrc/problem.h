// The problem in plain structs: what crosses from the torch side to the kernels of any device.
#pragma once

#include <cstdint>

#include "math/rheology.h"

namespace granpinn {

enum class Form { data, mixed, strong };

// Number of loss terms: velocity, surface, momentum, continuity, constitutive.
constexpr int kTerms = 5;

// Which of them a residual of a form belongs to.
GRANPINN_HD int term_of(int residual) { return residual < 2 ? 2 : residual == 2 ? 3 : 4; }

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
  T theta[3];  // mu_s, mu_2, I0
  T term_weights[kTerms];
  std::int64_t n, m;          // interior and surface points
  const T* points;            // [n, 3]
  const T* velocity;          // [n, 2]
  const T* point_weights;     // [n, 2]
  const T* surface_points;    // [m, 3]
  const T* surface_pressure;  // [m]
};

}  // namespace granpinn
