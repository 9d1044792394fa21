// The CUDA kernels behind the operators (csrc/ops/registration.h), and their shared helpers.
#pragma once

#include <c10/cuda/CUDAGuard.h>
#include <c10/cuda/CUDAStream.h>

#include "../ops/jets.h"
#include "../ops/pointwise.h"
#include "../ops/step.h"
#include "launch.h"

namespace granpinn::cuda {

struct CudaBackend {
  static void jet(const JetTensors& in, const at::Tensor& out);
  static void jet_adjoint(const JetTensors& in, const Shared& grad, const at::Tensor& grad_params);
  static LossResult loss(const LossTensors& in);
  static at::Tensor orthogonalize(const at::Tensor& G, c10::string_view precision);

  template <class T>
  static void viscosity(const ViscosityArguments<T>& a);
  template <class T>
  static void viscosity_adjoint(const ViscosityArguments<T>& a);
  template <class T>
  static void residuals(const ResidualArguments<T>& a);
  static void sample(const std::int64_t* step, std::uint64_t seed, std::uint32_t stream,
                     std::int64_t count, std::uint64_t population, std::int64_t* out);

  template <class T>
  static void draw(const BatchArguments<T>& a);
  template <class T>
  static void update(const UpdateArguments<T>& a);
  template <class T>
  static void descend(DescendArguments<T> a, const at::Tensor& G, c10::string_view precision);
};

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

// The caller sets the input map.
template <class T>
DeviceNetwork<T> device_network(const at::Tensor& params, Ints widths, std::int64_t count,
                                std::int64_t members) {
  DeviceNetwork<T> net{};
  net.layers = static_cast<int>(widths.size()) - 1;
  for (int l = 0; l <= net.layers; ++l) net.widths[l] = widths[l];
  net.members = members;
  net.count = count;
  net.params = params.const_data_ptr<T>();
  return net;
}

}  // namespace granpinn::cuda
