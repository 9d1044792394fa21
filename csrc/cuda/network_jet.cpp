// granpinn::network_jet and its adjoint on the GPU.
#include "backend.h"

namespace granpinn::cuda {

namespace {

template <class T>
DeviceJet<T> device_jet(const JetTensors& in) {
  DeviceJet<T> a{};
  a.net = device_network<T>(in.params, in.widths, in.count, in.members());
  for (int i = 0; i < 3; ++i) {
    a.net.input.shift_value[i] = static_cast<T>(in.shift[i]);
    a.net.input.scale_value[i] = static_cast<T>(in.scale[i]);
  }
  a.channels = in.channels;
  a.n = in.N;
  a.points = batched<T>(in.points);
  return a;
}

}  // namespace

void CudaBackend::jet(const JetTensors& in, const at::Tensor& out) {
  const c10::cuda::CUDAGuard guard(out.device());
  AT_DISPATCH_FLOATING_TYPES(out.scalar_type(), "network_jet", [&] {
    auto a = device_jet<scalar_t>(in);
    a.out = out.mutable_data_ptr<scalar_t>();
    const at::Tensor memory = scratch(layered_jet_scratch(a), out);
    check(layered_jet(a, memory.mutable_data_ptr(), c10::cuda::getCurrentCUDAStream()),
          "network_jet");
  });
}

void CudaBackend::jet_adjoint(const JetTensors& in, const Shared& grad,
                              const at::Tensor& grad_params) {
  const c10::cuda::CUDAGuard guard(grad_params.device());
  AT_DISPATCH_FLOATING_TYPES(grad_params.scalar_type(), "network_jet_backward", [&] {
    auto a = device_jet<scalar_t>(in);
    a.grad = batched<scalar_t>(grad);
    a.grad_params = grad_params.mutable_data_ptr<scalar_t>();
    const at::Tensor memory = scratch(layered_jet_scratch(a), grad_params);
    check(layered_jet_adjoint(a, memory.mutable_data_ptr(), c10::cuda::getCurrentCUDAStream()),
          "network_jet_backward");
  });
}

}  // namespace granpinn::cuda
