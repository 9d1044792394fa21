// granpinn::residual_loss on the GPU: the fused kernels where they fit, else layer after layer.
#include <algorithm>

#include "backend.h"
#include "fused/fused_loss.h"

namespace granpinn::cuda {

namespace {

template <class T>
DeviceLoss<T> device_loss(const LossTensors& in, const LossResult& out) {
  DeviceLoss<T> a{};
  a.net = device_network<T>(in.params, in.widths, in.count, in.members());
  a.net.input.shift = batched<T>(in.input_shift);
  a.net.input.scale = batched<T>(in.input_scale);
  a.form = in.form;
  a.law = in.laws[0];
  a.own_laws =
      std::any_of(in.laws.begin(), in.laws.end(), [&](LawName name) { return name != in.laws[0]; });
  GRANPINN_CHECK_VALUE(!a.own_laws || in.laws.size() <= kMaxOwnLaws, "on a GPU at most ",
                       kMaxOwnLaws, " members can have different laws, got ", in.laws.size());
  if (a.own_laws)
    std::transform(in.laws.begin(), in.laws.end(), a.laws,
                   [](LawName name) { return static_cast<std::uint8_t>(name); });
  a.parameters = in.parameters;
  a.drawn = in.drawn;
  a.n = in.n;
  a.m = in.m;
  a.theta = batched<T>(in.theta);
  a.points = batched<T>(in.points);
  a.velocity = batched<T>(in.velocity);
  a.point_weights = batched<T>(in.point_weights);
  if (in.source.data.defined()) a.source = batched<T>(in.source);
  a.surface_points = batched<T>(in.surface_points);
  a.surface_pressure = batched<T>(in.surface_pressure);
  a.term_weights = batched<T>(in.term_weights);
  a.physics = batched<T>(in.physics);
  a.loss = std::get<0>(out).mutable_data_ptr<T>();
  a.terms = std::get<1>(out).mutable_data_ptr<T>();
  a.grad_params = std::get<2>(out).mutable_data_ptr<T>();
  a.grad_theta = std::get<3>(out).mutable_data_ptr<T>();
  return a;
}

// A limit of the current device. torch's own header for it would need all libraries of CUDA.
int limit(cudaDeviceAttr name) {
  int device = 0, value = 0;
  check(cudaGetDevice(&device), "residual_loss");
  check(cudaDeviceGetAttribute(&value, name, device), "residual_loss");
  return value;
}

template <class T>
cudaError_t evaluate(const DeviceLoss<T>& a, bool fast, const at::Tensor& params) {
  const auto stream = c10::cuda::getCurrentCUDAStream();
  if constexpr (std::is_same_v<T, float>) {
    const fused::DeviceLimits device{limit(cudaDevAttrMultiProcessorCount),
                                     limit(cudaDevAttrMaxSharedMemoryPerBlockOptin),
                                     limit(cudaDevAttrMaxSharedMemoryPerMultiprocessor)};
    fused::LaunchPlan plan;
    if (fused::make_launch_plan(a, fast, device, plan)) {
      const at::Tensor memory = scratch(fused::scratch_size(a, plan), params);
      return fused::loss(a, plan, memory.mutable_data_ptr(), stream);
    }
  }
  const at::Tensor memory = scratch(layered_loss_scratch(a), params);
  return layered_loss(a, memory.mutable_data_ptr(), stream);
}

}  // namespace

LossResult CudaBackend::loss(const LossTensors& in) {
  const c10::cuda::CUDAGuard guard(in.params.device());
  LossResult out = in.results();
  AT_DISPATCH_FLOATING_TYPES(in.params.scalar_type(), "residual_loss", [&] {
    check(evaluate(device_loss<scalar_t>(in, out), in.fast, in.params), "residual_loss");
  });
  return out;
}

}  // namespace granpinn::cuda
