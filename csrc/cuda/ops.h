// The CUDA implementations behind the operators of torch_library.cpp, and what they share.
#pragma once

#include <c10/cuda/CUDAGuard.h>
#include <c10/cuda/CUDAStream.h>

#include "launch.h"
#include "loss_tensors.h"

namespace granpinn::cuda {

at::Tensor network_jet(const at::Tensor& points, const at::Tensor& params, Ints widths,
                       Doubles shift, Doubles scale, std::int64_t order);

at::Tensor network_jet_backward(const at::Tensor& grad, const at::Tensor& points,
                                const at::Tensor& params, Ints widths, Doubles shift, Doubles scale,
                                std::int64_t order);

LossResult residual_loss(const at::Tensor& params, const at::Tensor& theta,
                         const at::Tensor& points, const at::Tensor& velocity,
                         const at::Tensor& point_weights, const at::Tensor& surface_points,
                         const at::Tensor& surface_pressure, const at::Tensor& term_weights,
                         Ints widths, const at::Tensor& input_shift, const at::Tensor& input_scale,
                         const at::Tensor& physics, c10::string_view form,
                         c10::string_view precision);

// The same when the last launch was that of draw_batch, for at least one member.
LossResult drawn_loss(const at::Tensor& params, const at::Tensor& theta, const at::Tensor& points,
                      const at::Tensor& velocity, const at::Tensor& point_weights,
                      const at::Tensor& surface_points, const at::Tensor& surface_pressure,
                      const at::Tensor& term_weights, Ints widths, const at::Tensor& input_shift,
                      const at::Tensor& input_scale, const at::Tensor& physics,
                      c10::string_view form, c10::string_view precision);

at::Tensor viscosity(const at::Tensor& gamma_dot, const at::Tensor& p, const at::Tensor& theta,
                     double d, double eta_min, double eta_max, double p_floor);

std::tuple<at::Tensor, at::Tensor, at::Tensor> viscosity_backward(
    const at::Tensor& grad, const at::Tensor& gamma_dot, const at::Tensor& p,
    const at::Tensor& theta, double d, double eta_min, double eta_max, double p_floor);

at::Tensor pointwise_residuals(const at::Tensor& raw_jets, const at::Tensor& theta, Doubles physics,
                               c10::string_view form);

at::Tensor sample_indices(const at::Tensor& step, std::int64_t seed, std::int64_t stream,
                          std::int64_t count, std::int64_t population);

inline void check(cudaError_t status, const char* operation) {
  TORCH_CHECK(status == cudaSuccess,
              message("granpinn::", operation, " could not be launched on the GPU: ",
                      cudaGetErrorString(status), "; see python -m granpinn.doctor"));
}

// Memory of the caching allocator, free again for later work of the same stream.
inline at::Tensor scratch(std::size_t bytes, const at::Tensor& like) {
  return at::empty({static_cast<std::int64_t>(bytes)}, like.options().dtype(at::kByte));
}

template <class T>
Batched<T> batched(const Shared& a) {
  return {a.data.const_data_ptr<T>(), a.stride};
}

// The input map is left to the caller.
template <class T>
DeviceNetwork<T> device_network(const at::Tensor& params, Ints widths, std::int64_t count,
                                std::int64_t members) {
  const auto layers = static_cast<std::int64_t>(widths.size()) - 1;
  GRANPINN_CHECK_VALUE(layers <= kMaxLayers, "a network on the GPU has at most ", kMaxLayers,
                       " layers, got widths ", widths);
  DeviceNetwork<T> net{};
  net.layers = static_cast<int>(layers);
  for (std::int64_t l = 0; l <= layers; ++l) net.widths[l] = widths[l];
  net.members = members;
  net.count = count;
  net.params = params.const_data_ptr<T>();
  return net;
}

}  // namespace granpinn::cuda
