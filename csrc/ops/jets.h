// granpinn::network_jet and its adjoint: the arguments, checked, as one struct for the backends.
//
// `Backend::jet(in, out)` and `Backend::jet_adjoint(in, grad, grad_params)` fill their last tensor.
#pragma once

#include "arguments.h"

namespace granpinn {

struct JetTensors {
  Ints widths;
  Doubles shift, scale;
  std::int64_t count, E, N;  // parameters; ensemble size, 0 without the axis; points
  int channels;
  at::Tensor params;
  Shared points;

  std::int64_t members() const { return E ? E : 1; }
  std::int64_t outputs() const { return widths.back(); }
};

inline JetTensors jet_tensors(const at::Tensor& points, const at::Tensor& params, Ints widths,
                              Doubles shift, Doubles scale, std::int64_t order) {
  JetTensors in{widths, shift, scale, parameter_count(widths, shift, scale), 0, 0, 0, {}, {}};
  in.E = ensemble_size(params, in.count);
  in.channels = channels_of_order(order);
  in.points = shared("points", points, params, in.E, {-1, 3});
  in.params = params.contiguous();
  in.N = points.size(-2);
  return in;
}

template <class Backend>
at::Tensor network_jet(const at::Tensor& points, const at::Tensor& params, Ints widths,
                       Doubles shift, Doubles scale, std::int64_t order) {
  const JetTensors in = jet_tensors(points, params, widths, shift, scale, order);
  std::vector<std::int64_t> shape{in.channels, in.N, in.outputs()};
  if (in.E) shape.insert(shape.begin(), in.E);
  at::Tensor out = at::empty(shape, params.options());
  Backend::jet(in, out);
  return out;
}

template <class Backend>
at::Tensor network_jet_backward(const at::Tensor& grad, const at::Tensor& points,
                                const at::Tensor& params, Ints widths, Doubles shift, Doubles scale,
                                std::int64_t order) {
  const JetTensors in = jet_tensors(points, params, widths, shift, scale, order);
  const Shared g = shared("grad", grad, params, in.E, {in.channels, in.N, in.outputs()});
  at::Tensor out = at::empty(params.sizes(), params.options());
  Backend::jet_adjoint(in, g, out);
  return out;
}

}  // namespace granpinn
