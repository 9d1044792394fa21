// The CPU implementations behind the operators of torch_library.cpp.
#pragma once

#include "loss_tensors.h"

namespace granpinn {

at::Tensor network_jet_cpu(const at::Tensor& points, const at::Tensor& params, Ints widths,
                           Doubles shift, Doubles scale, std::int64_t order);

at::Tensor network_jet_backward_cpu(const at::Tensor& grad, const at::Tensor& points,
                                    const at::Tensor& params, Ints widths, Doubles shift,
                                    Doubles scale, std::int64_t order);

LossResult residual_loss_cpu(const at::Tensor& params, const at::Tensor& theta,
                             const at::Tensor& points, const at::Tensor& velocity,
                             const at::Tensor& point_weights, const at::Tensor& surface_points,
                             const at::Tensor& surface_pressure, const at::Tensor& term_weights,
                             Ints widths, const at::Tensor& input_shift,
                             const at::Tensor& input_scale, const at::Tensor& physics,
                             c10::string_view form, c10::string_view precision);

at::Tensor viscosity_cpu(const at::Tensor& gamma_dot, const at::Tensor& p, const at::Tensor& theta,
                         double d, double eta_min, double eta_max, double p_floor);

std::tuple<at::Tensor, at::Tensor, at::Tensor> viscosity_backward_cpu(
    const at::Tensor& grad, const at::Tensor& gamma_dot, const at::Tensor& p,
    const at::Tensor& theta, double d, double eta_min, double eta_max, double p_floor);

at::Tensor pointwise_residuals_cpu(const at::Tensor& raw_jets, const at::Tensor& theta,
                                   Doubles physics, c10::string_view form);

at::Tensor sample_indices_cpu(const at::Tensor& step, std::int64_t seed, std::int64_t stream,
                              std::int64_t count, std::int64_t population);

at::Tensor orthogonalize_cpu(const at::Tensor& G, c10::string_view precision);

}  // namespace granpinn
