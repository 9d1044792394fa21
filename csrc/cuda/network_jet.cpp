// granpinn::network_jet and its adjoint on the GPU.
#include "ops.h"

namespace granpinn::cuda {

namespace {

struct JetTensors {
  std::int64_t count, E, members, N, K;
  int channels;
  at::Tensor params;
  Shared points;
};

JetTensors jet_tensors(const at::Tensor& points, const at::Tensor& params, Ints widths,
                       Doubles shift, Doubles scale, std::int64_t order) {
  JetTensors in{};
  in.count = parameter_count(widths, shift, scale);
  in.E = ensemble_size(params, in.count);
  in.members = in.E ? in.E : 1;
  in.channels = channels_of(order);
  in.points = shared("points", points, params, in.E, {-1, 3});
  in.params = params.contiguous();
  in.N = points.size(-2);
  in.K = widths.back();
  return in;
}

template <class T>
DeviceJet<T> device_jet(const JetTensors& in, Ints widths, Doubles shift, Doubles scale) {
  DeviceJet<T> a{};
  a.net = device_network<T>(in.params, widths, in.count, in.members);
  for (int i = 0; i < 3; ++i) {
    a.net.input.shift_value[i] = static_cast<T>(shift[i]);
    a.net.input.scale_value[i] = static_cast<T>(scale[i]);
  }
  a.channels = in.channels;
  a.n = in.N;
  a.points = batched<T>(in.points);
  return a;
}

}  // namespace

at::Tensor network_jet(const at::Tensor& points, const at::Tensor& params, Ints widths,
                       Doubles shift, Doubles scale, std::int64_t order) {
  const JetTensors in = jet_tensors(points, params, widths, shift, scale, order);
  const c10::cuda::CUDAGuard guard(params.device());
  std::vector<std::int64_t> shape{in.channels, in.N, in.K};
  if (in.E) shape.insert(shape.begin(), in.E);
  at::Tensor out = at::empty(shape, params.options());
  AT_DISPATCH_FLOATING_TYPES(params.scalar_type(), "network_jet", [&] {
    auto a = device_jet<scalar_t>(in, widths, shift, scale);
    a.out = out.mutable_data_ptr<scalar_t>();
    const at::Tensor memory = scratch(layered_jet_scratch(a), params);
    check(layered_jet(a, memory.mutable_data_ptr(), c10::cuda::getCurrentCUDAStream()),
          "network_jet");
  });
  return out;
}

at::Tensor network_jet_backward(const at::Tensor& grad, const at::Tensor& points,
                                const at::Tensor& params, Ints widths, Doubles shift, Doubles scale,
                                std::int64_t order) {
  const JetTensors in = jet_tensors(points, params, widths, shift, scale, order);
  const Shared g = shared("grad", grad, params, in.E, {in.channels, in.N, in.K});
  const c10::cuda::CUDAGuard guard(params.device());
  at::Tensor out = at::empty(params.sizes(), params.options());
  AT_DISPATCH_FLOATING_TYPES(params.scalar_type(), "network_jet_backward", [&] {
    auto a = device_jet<scalar_t>(in, widths, shift, scale);
    a.grad = batched<scalar_t>(g);
    a.grad_params = out.mutable_data_ptr<scalar_t>();
    const at::Tensor memory = scratch(layered_jet_scratch(a), params);
    check(layered_jet_adjoint(a, memory.mutable_data_ptr(), c10::cuda::getCurrentCUDAStream()),
          "network_jet_backward");
  });
  return out;
}

}  // namespace granpinn::cuda
