// granpinn::network_jet and its adjoint on the CPU.
#include "backend.h"
#include "threads.h"

namespace granpinn {

namespace {

// Calls work(e, net, x, team) for every member: its network, points and threads.
template <class T, class Work>
void each_member(const JetTensors& in, const Work& work) {
  for (std::int64_t e = 0; e < in.members(); ++e) {
    const T* params = in.params.const_data_ptr<T>() + e * in.count;
    const auto net = network(params, in.widths, in.shift, in.scale);
    work(e, net, in.points.member<T>(e), Team<T>(net, in.channels, tiles_of(in.N)));
  }
}

}  // namespace

void CpuBackend::jet(const JetTensors& in, const at::Tensor& out) {
  AT_DISPATCH_FLOATING_TYPES(out.scalar_type(), "network_jet", [&] {
    using T = scalar_t;
    each_member<T>(in, [&](std::int64_t e, const auto& net, const T* x, const auto& team) {
      T* to = out.mutable_data_ptr<T>() + e * in.channels * in.N * in.outputs();
      split(team.size(), tiles_of(in.N), [&](std::int64_t i, std::int64_t begin, std::int64_t end) {
        kernels<T>().jet(net, in.channels, x, begin * kTilePoints,
                         std::min(end * kTilePoints, in.N), in.N, to, team.workspace(i));
      });
    });
  });
}

void CpuBackend::jet_adjoint(const JetTensors& in, const Shared& grad,
                             const at::Tensor& grad_params) {
  AT_DISPATCH_FLOATING_TYPES(grad_params.scalar_type(), "network_jet_backward", [&] {
    using T = scalar_t;
    each_member<T>(in, [&](std::int64_t e, const auto& net, const T* x, const auto& team) {
      split(team.size(), tiles_of(in.N), [&](std::int64_t i, std::int64_t begin, std::int64_t end) {
        GradientSum<T> mine = team.gradient(i);
        kernels<T>().jet_adjoint(net, in.channels, x, begin * kTilePoints,
                                 std::min(end * kTilePoints, in.N), in.N, grad.member<T>(e), &mine,
                                 team.workspace(i));
        mine.flush();
      });
      team.sum(grad_params.mutable_data_ptr<T>() + e * in.count);
    });
  });
}

}  // namespace granpinn
