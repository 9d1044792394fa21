// The operators of granpinn: their schemas.
//
// Shapes, meaning and gradients are documented in granpinn/kernels/ops.py.
#include <torch/library.h>

TORCH_LIBRARY(granpinn, m) {
  m.def(
      "network_jet(Tensor points, Tensor params, int[] widths, float[] input_shift, "
      "float[] input_scale, int order) -> Tensor");
  m.def(
      "network_jet_backward(Tensor grad, Tensor points, Tensor params, int[] widths, "
      "float[] input_shift, float[] input_scale, int order) -> Tensor");
  m.def(
      "residual_loss(Tensor params, Tensor theta, Tensor points, Tensor velocity, "
      "Tensor point_weights, Tensor surface_points, Tensor surface_pressure, Tensor term_weights, "
      "int[] widths, Tensor input_shift, Tensor input_scale, Tensor physics, str form, "
      "str law, str precision, Tensor? source=None) -> (Tensor, Tensor, Tensor, Tensor)");
  m.def(
      "viscosity(Tensor gamma_dot, Tensor p, Tensor theta, str law, float d, float eta_min, float "
      "eta_max, "
      "float p_floor) -> Tensor");
  m.def(
      "viscosity_backward(Tensor grad, Tensor gamma_dot, Tensor p, Tensor theta, str law, float d, "
      "float eta_min, float eta_max, float p_floor) -> (Tensor, Tensor, Tensor)");
  m.def(
      "pointwise_residuals(Tensor raw_jets, Tensor theta, float[] physics, str form, str law) "
      "-> Tensor");
  m.def("sample_indices(Tensor step, int seed, int stream, int count, int population) -> Tensor");
  m.def("orthogonalize(Tensor G, str precision='fp32') -> Tensor");
  m.def(
      "draw_batch(Tensor counter, Tensor table, Tensor seeds, Tensor places, Tensor points, "
      "Tensor velocity, Tensor point_weights, Tensor surface_points, Tensor surface_pressure, "
      "Tensor term_weights, int interior, int surface, Tensor? source=None) "
      "-> (Tensor, Tensor, Tensor, Tensor, Tensor, Tensor, Tensor)");
  m.def(
      "batch_loss(Tensor counter, Tensor table, Tensor seeds, Tensor places, Tensor points, "
      "Tensor velocity, Tensor point_weights, Tensor surface_points, Tensor surface_pressure, "
      "Tensor term_weights, int interior, int surface, Tensor params, Tensor theta, "
      "int[] widths, Tensor input_shift, Tensor input_scale, Tensor physics, str form, str law, "
      "str precision, Tensor? source=None) -> (Tensor, Tensor, Tensor, Tensor)");
  m.def(
      "update(Tensor(a!) counter, Tensor table, Tensor lr_scale, Tensor(b!) fault, "
      "Tensor(c!) counts, Tensor loss, Tensor gradient, Tensor(d!) params, Tensor(e!) first, "
      "Tensor(f!) second, Tensor(g!) direction, int[] matrices, float[] adam, float momentum, "
      "Tensor grad_theta, Tensor(h!) q, Tensor(i!) first_q, Tensor(j!) second_q, "
      "Tensor(k!) theta, float[] law_adam, Tensor variables, Tensor bounds, bool law_moves) -> ()");
  m.def(
      "descend(Tensor counter, Tensor table, Tensor lr_scale, Tensor(a!) fault, Tensor counts, "
      "Tensor G, Tensor(b!) params, int offset, int apart, float learning_rate, "
      "str precision) -> ()");
}

// torch's own handling of negated views ends the process for an operator that returns nothing.
// These operators refuse such views (InPlace::spans).
TORCH_LIBRARY_IMPL(granpinn, Negative, m) {
  m.impl("update", torch::CppFunction::makeFallthrough());
  m.impl("descend", torch::CppFunction::makeFallthrough());
}
