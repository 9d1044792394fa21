// The operators of an optimization step on the GPU.
#include <type_traits>

#include "ops.h"
#include "orthogonalize.h"
#include "step_launch.h"
#include "step_ops.h"

namespace granpinn::cuda {

namespace {

struct CudaStep {
  template <class T>
  static void draw(const BatchArguments<T>& a) {
    cuda::check(draw_batch(a, c10::cuda::getCurrentCUDAStream()), "draw_batch");
  }
  template <class... Arguments>
  static LossResult loss(const Arguments&... arguments) {
    return drawn_loss(arguments...);
  }
  template <class T>
  static void update(const UpdateArguments<T>& a) {
    cuda::check(cuda::update(a, c10::cuda::getCurrentCUDAStream()), "update");
  }
  template <class T>
  static void descend(DescendArguments<T> a, const at::Tensor& G, c10::string_view precision) {
    const auto stream = c10::cuda::getCurrentCUDAStream();
    if constexpr (std::is_same_v<T, float>)
      if (fast_precision(precision) && newton_schulz_fits_half(G.size(2), G.size(3))) {
        const at::Tensor from = spread(G);
        return cuda::check(descend_in_half(matrices<T>(from), a, stream), "descend");
      }
    const at::Tensor factors = orthogonalize(G, precision);
    a.U = factors.const_data_ptr<T>();
    cuda::check(descend_matrices(a, stream), "descend");
  }
};

}  // namespace

TORCH_LIBRARY_IMPL(granpinn, CUDA, m) { register_step<CudaStep>(m); }

}  // namespace granpinn::cuda
