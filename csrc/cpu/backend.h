// The CPU kernels behind the operators (csrc/ops/registration.h).
#pragma once

#include "../ops/jets.h"
#include "../ops/pointwise.h"
#include "../ops/step.h"
#include "kernel_table.h"

namespace granpinn {

struct CpuBackend {
  static void jet(const JetTensors& in, const at::Tensor& out);
  static void jet_adjoint(const JetTensors& in, const Shared& grad, const at::Tensor& grad_params);
  static LossResult loss(const LossTensors& in);
  static at::Tensor orthogonalize(const at::Tensor& G, c10::string_view precision);

  template <class T>
  static void viscosity(const ViscosityArguments<T>& a) {
    kernels<T>().viscosity(a);
  }
  template <class T>
  static void viscosity_adjoint(const ViscosityArguments<T>& a) {
    kernels<T>().viscosity_adjoint(a);
  }
  template <class T>
  static void residuals(const ResidualArguments<T>& a) {
    kernels<T>().residuals(a);
  }
  static void sample(const std::int64_t* step, std::uint64_t seed, std::uint32_t stream,
                     std::int64_t count, std::uint64_t population, std::int64_t* out);

  // The step (step.cpp).
  template <class T>
  static void draw(const BatchArguments<T>& a);
  template <class T>
  static void update(const UpdateArguments<T>& a);
  template <class T>
  static void descend(DescendArguments<T> a, const at::Tensor& G, c10::string_view precision);
};

}  // namespace granpinn
