// granpinn::orthogonalize on the CPU: one matrix after another on every thread.
#include "backend.h"
#include "threads.h"

namespace granpinn {

at::Tensor CpuBackend::orthogonalize(const at::Tensor& G, c10::string_view precision) {
  check_matrices(G);
  fast_precision(precision);  // checked, and without effect on a CPU
  const at::Tensor from = G.contiguous();
  at::Tensor out = at::empty_like(from);
  const std::int64_t m = G.size(-2), n = G.size(-1);
  if (from.numel() == 0) return out;
  const std::int64_t count = from.numel() / (m * n), team = team_size(count);
  const std::int64_t R = padded(std::min(m, n)), C = padded(std::max(m, n));
  const std::int64_t scratch = checked_mul(2 * R, R + C);
  const at::Tensor memory = at::empty({checked_mul(team, scratch)}, from.options());
  AT_DISPATCH_FLOATING_TYPES(from.scalar_type(), "orthogonalize", [&] {
    const scalar_t* source = from.const_data_ptr<scalar_t>();
    scalar_t *to = out.mutable_data_ptr<scalar_t>(), *own = memory.mutable_data_ptr<scalar_t>();
    split(team, count, [&](std::int64_t thread, std::int64_t begin, std::int64_t end) {
      for (std::int64_t k = begin; k < end; ++k)
        kernels<scalar_t>().orthogonalize(source + k * m * n, m, n, to + k * m * n,
                                          own + thread * scratch);
    });
  });
  return out;
}

}  // namespace granpinn
