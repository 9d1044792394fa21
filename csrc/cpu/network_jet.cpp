// granpinn::network_jet and its adjoint on the CPU.
#include "ops.h"
#include "threads.h"

namespace granpinn {

at::Tensor network_jet_cpu(const at::Tensor& points, const at::Tensor& params, Ints widths,
                           Doubles shift, Doubles scale, std::int64_t order) {
  const std::int64_t count = parameter_count(widths, shift, scale);
  const std::int64_t E = ensemble_size(params, count), members = E ? E : 1;
  const Shared x = shared("points", points, params, E, {-1, 3});
  const at::Tensor flat = params.contiguous();
  const int C = channels_of(order);
  const std::int64_t N = points.size(-2), K = widths.back();
  at::Tensor out =
      E ? at::empty({E, C, N, K}, params.options()) : at::empty({C, N, K}, params.options());
  AT_DISPATCH_FLOATING_TYPES(params.scalar_type(), "network_jet", [&] {
    for (std::int64_t e = 0; e < members; ++e) {
      const auto net = network(flat.const_data_ptr<scalar_t>() + e * count, widths, shift, scale);
      const std::int64_t tiles = tiles_of(N);
      const Team<scalar_t> team(net, C, tiles);
      scalar_t* to = out.mutable_data_ptr<scalar_t>() + e * C * N * K;
      split(team.size(), tiles, [&](std::int64_t i, std::int64_t begin, std::int64_t end) {
        kernels<scalar_t>().jet(net, C, x.member<scalar_t>(e), begin * kTilePoints,
                                std::min(end * kTilePoints, N), N, to, team.workspace(i));
      });
    }
  });
  return out;
}

at::Tensor network_jet_backward_cpu(const at::Tensor& grad, const at::Tensor& points,
                                    const at::Tensor& params, Ints widths, Doubles shift,
                                    Doubles scale, std::int64_t order) {
  const std::int64_t count = parameter_count(widths, shift, scale);
  const std::int64_t E = ensemble_size(params, count), members = E ? E : 1;
  const Shared x = shared("points", points, params, E, {-1, 3});
  const at::Tensor flat = params.contiguous();
  const int C = channels_of(order);
  const std::int64_t N = points.size(-2), K = widths.back();
  const Shared g = shared("grad", grad, params, E, {C, N, K});
  at::Tensor out = at::empty(params.sizes(), params.options());
  AT_DISPATCH_FLOATING_TYPES(params.scalar_type(), "network_jet_backward", [&] {
    for (std::int64_t e = 0; e < members; ++e) {
      const auto net = network(flat.const_data_ptr<scalar_t>() + e * count, widths, shift, scale);
      const std::int64_t tiles = tiles_of(N);
      const Team<scalar_t> team(net, C, tiles);
      split(team.size(), tiles, [&](std::int64_t i, std::int64_t begin, std::int64_t end) {
        GradientSum<scalar_t> mine = team.gradient(i);
        kernels<scalar_t>().jet_adjoint(net, C, x.member<scalar_t>(e), begin * kTilePoints,
                                        std::min(end * kTilePoints, N), N, g.member<scalar_t>(e),
                                        &mine, team.workspace(i));
        mine.flush();
      });
      team.sum(out.mutable_data_ptr<scalar_t>() + e * count);
    }
  });
  return out;
}

}  // namespace granpinn
