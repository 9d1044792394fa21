// Puts a backend behind every operator, with the names of schemas.cpp.
#pragma once

#include <torch/library.h>

#include "jets.h"
#include "pointwise.h"
#include "residual_loss.h"
#include "step.h"

namespace granpinn {

template <class Backend>
void register_operators(torch::Library& m) {
  m.impl("network_jet", &network_jet<Backend>);
  m.impl("network_jet_backward", &network_jet_backward<Backend>);
  m.impl("residual_loss", &ResidualLoss<Backend>::evaluate);
  m.impl("viscosity", &viscosity<Backend>);
  m.impl("viscosity_backward", &viscosity_backward<Backend>);
  m.impl("pointwise_residuals", &pointwise_residuals<Backend>);
  m.impl("sample_indices", &sample_indices<Backend>);
  m.impl("orthogonalize", &Backend::orthogonalize);
  m.impl("draw_batch", &StepOps<Backend>::draw_batch);
  m.impl("batch_loss", &StepOps<Backend>::batch_loss);
  m.impl("update", &StepOps<Backend>::update);
  m.impl("descend", &StepOps<Backend>::descend);
}

}  // namespace granpinn
