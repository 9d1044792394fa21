// Registers the CUDA implementations of the operators. torch_library.cpp has the schemas.
#include <torch/library.h>

#include "ops.h"

TORCH_LIBRARY_IMPL(granpinn, CUDA, m) {
  m.impl("network_jet", &granpinn::cuda::network_jet);
  m.impl("network_jet_backward", &granpinn::cuda::network_jet_backward);
  m.impl("residual_loss", &granpinn::cuda::residual_loss);
  m.impl("viscosity", &granpinn::cuda::viscosity);
  m.impl("viscosity_backward", &granpinn::cuda::viscosity_backward);
  m.impl("pointwise_residuals", &granpinn::cuda::pointwise_residuals);
  m.impl("sample_indices", &granpinn::cuda::sample_indices);
}
