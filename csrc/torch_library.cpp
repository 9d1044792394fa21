// The operators of granpinn: schemas, and the CPU kernels behind them; and the Python module.
//
// Shapes, meaning and gradients are documented where users meet them: granpinn/kernels/ops.py.
#include <pybind11/pybind11.h>
#include <torch/library.h>

#include <algorithm>
#include <chrono>

#include "build_info.h"
#include "cpu/kernel_table.h"
#include "cpu/ops.h"

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
      "str precision) -> (Tensor, Tensor, Tensor, Tensor)");
  m.def(
      "viscosity(Tensor gamma_dot, Tensor p, Tensor theta, float d, float eta_min, float eta_max, "
      "float p_floor) -> Tensor");
  m.def(
      "viscosity_backward(Tensor grad, Tensor gamma_dot, Tensor p, Tensor theta, float d, "
      "float eta_min, float eta_max, float p_floor) -> (Tensor, Tensor, Tensor)");
  m.def("pointwise_residuals(Tensor raw_jets, Tensor theta, float[] physics, str form) -> Tensor");
  m.def("sample_indices(Tensor step, int seed, int stream, int count, int population) -> Tensor");
  m.def("orthogonalize(Tensor G, str precision='fp32') -> Tensor");
  m.def(
      "draw_batch(Tensor counter, Tensor table, Tensor seeds, Tensor places, Tensor points, "
      "Tensor velocity, Tensor point_weights, Tensor surface_points, Tensor surface_pressure, "
      "Tensor term_weights, int interior, int surface, int share) "
      "-> (Tensor, Tensor, Tensor, Tensor, Tensor, Tensor)");
  m.def(
      "batch_loss(Tensor counter, Tensor table, Tensor seeds, Tensor places, Tensor points, "
      "Tensor velocity, Tensor point_weights, Tensor surface_points, Tensor surface_pressure, "
      "Tensor term_weights, int interior, int surface, int share, Tensor params, Tensor theta, "
      "int[] widths, Tensor input_shift, Tensor input_scale, Tensor physics, str form, "
      "str precision) -> (Tensor, Tensor, Tensor, Tensor)");
  m.def(
      "update(Tensor(a!) counter, Tensor table, Tensor slower, Tensor(b!) fault, "
      "Tensor(c!) counts, Tensor loss, Tensor gradient, Tensor(d!) params, Tensor(e!) first, "
      "Tensor(f!) second, Tensor(g!) direction, Tensor(h!) average_params, int[] matrices, "
      "float[] adam, float momentum, Tensor grad_theta, Tensor(i!) q, Tensor(j!) first_q, "
      "Tensor(k!) second_q, Tensor(l!) theta, Tensor(m!) average_q, float[] law_adam, "
      "str variables, bool law_moves) -> ()");
  m.def(
      "descend(Tensor counter, Tensor table, Tensor slower, Tensor(a!) fault, Tensor counts, "
      "Tensor G, Tensor(b!) params, Tensor(c!) average_params, int offset, int apart, "
      "float learning_rate, str precision) -> ()");
}

TORCH_LIBRARY_IMPL(granpinn, CPU, m) {
  m.impl("network_jet", &granpinn::network_jet_cpu);
  m.impl("network_jet_backward", &granpinn::network_jet_backward_cpu);
  m.impl("residual_loss", &granpinn::residual_loss_cpu);
  m.impl("viscosity", &granpinn::viscosity_cpu);
  m.impl("viscosity_backward", &granpinn::viscosity_backward_cpu);
  m.impl("pointwise_residuals", &granpinn::pointwise_residuals_cpu);
  m.impl("sample_indices", &granpinn::sample_indices_cpu);
  m.impl("orthogonalize", &granpinn::orthogonalize_cpu);
}

PYBIND11_MODULE(_C, m) {
  m.doc() = "granpinn's compiled kernels; importing this registers torch.ops.granpinn";
  m.def("build_info", [] {
    namespace build = granpinn::build;
    pybind11::dict info;
    info["version"] = build::version;
    info["compiler"] = build::compiler;
    info["flags"] = build::flags;
    info["build_type"] = build::build_type;
    info["torch_version"] = build::torch_version;
    info["simd"] = build::simd;
    info["cuda_compiler"] = build::cuda_compiler;
    info["cuda_architectures"] = build::cuda_architectures;
    info["cuda_missing"] = build::cuda_missing;
    return info;
  });
  m.def(
      "fma_peak",
      [](double seconds) {
        using clock = std::chrono::steady_clock;
        float sink[] = {0.999f, 1e-3f};
        double best = 0;
        const auto begin = clock::now();
        do {
          const auto start = clock::now();
          const double flop = granpinn::kernels<float>().multiply_add(1 << 17, sink);
          const std::chrono::duration<double> time = clock::now() - start;
          best = std::max(best, flop / time.count() * 1e-9);
          sink[0] = 0.999f;
        } while (std::chrono::duration<double>(clock::now() - begin).count() < seconds);
        return best;
      },
      pybind11::arg("seconds") = 0.2,
      "Multiply-add peak of one core in GFLOP/s, float32, in the active instruction set.");
  m.def("cpu_capability", [] { return granpinn::kernels<float>().name; });
}
