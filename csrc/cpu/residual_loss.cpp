// granpinn::residual_loss on the CPU: loss terms and all gradients in one pass over the tiles.
#include "backend.h"
#include "threads.h"

namespace granpinn {

namespace {

template <class T>
LossArguments<T> member_arguments(const LossTensors& in, std::int64_t e) {
  const T* params = in.params.const_data_ptr<T>() + e * in.count;
  LossArguments<T> a{};
  a.net = network(params, in.widths, in.input_shift.member<T>(e), in.input_scale.member<T>(e));
  a.form = in.form;
  a.physics = physics_from<T>(in.physics.member<T>(e));
  a.law = in.law_of(e);
  for (int i = 0; i < parameters_of(a.law); ++i) a.theta[i] = in.theta.member<T>(e)[i];
  for (int i = 0; i < kTerms; ++i) a.term_weights[i] = in.term_weights.member<T>(e)[i];
  a.n = in.n;
  a.m = in.m;
  a.points = in.points.member<T>(e);
  a.velocity = in.velocity.member<T>(e);
  a.point_weights = in.point_weights.member<T>(e);
  a.source = in.source_of<T>(e);
  a.surface_points = in.surface_points.member<T>(e);
  a.surface_pressure = in.surface_pressure.member<T>(e);
  return a;
}

// One member: terms [kTerms], gradients; returns the loss. grad_theta has `parameters` values, 0
// beyond those of the law.
template <class T>
double member_loss(const LossArguments<T>& a, T* terms, T* grad_params, T* grad_theta,
                   int parameters) {
  const std::int64_t interior = tiles_of(a.n), tiles = interior + tiles_of(a.m);
  const Team<T> team(a.net, channels_of(a.form), tiles);
  std::vector<LossSums<T>> sums(team.size());
  // surface tiles are cheaper than interior tiles: each kind is split by itself
  split(team.size(), team.size(), [&](std::int64_t i, std::int64_t, std::int64_t) {
    sums[i].gradient = team.gradient(i);
    const auto share = [&](std::int64_t count, std::int64_t k) { return k * count / team.size(); };
    kernels<T>().loss(a, share(interior, i), share(interior, i + 1), &sums[i], team.workspace(i));
    kernels<T>().loss(a, interior + share(tiles - interior, i),
                      interior + share(tiles - interior, i + 1), &sums[i], team.workspace(i));
    sums[i].gradient.flush();
  });
  team.sum(grad_params);
  double loss = 0;
  for (int k = 0; k < kTerms; ++k) {
    double square = 0;
    for (const auto& s : sums) square += s.squares[k];
    const std::int64_t points = k == kSurface ? a.m : a.n;
    const double term = points ? square / (2.0 * static_cast<double>(points)) : 0.0;
    terms[k] = static_cast<T>(term);
    loss += static_cast<double>(a.term_weights[k]) * term;
  }
  for (int i = 0; i < parameters; ++i) {
    double sum = 0;
    for (const auto& s : sums) sum += s.theta[i];
    grad_theta[i] = static_cast<T>(sum);
  }
  return loss;
}

}  // namespace

LossResult CpuBackend::loss(const LossTensors& in) {
  const LossResult out = in.results();
  AT_DISPATCH_FLOATING_TYPES(in.params.scalar_type(), "residual_loss", [&] {
    auto* losses = std::get<0>(out).mutable_data_ptr<scalar_t>();
    auto* each_terms = std::get<1>(out).mutable_data_ptr<scalar_t>();
    auto* by_params = std::get<2>(out).mutable_data_ptr<scalar_t>();
    auto* by_theta = std::get<3>(out).mutable_data_ptr<scalar_t>();
    for (std::int64_t e = 0; e < in.members(); ++e)
      losses[e] = static_cast<scalar_t>(
          member_loss(member_arguments<scalar_t>(in, e), each_terms + e * kTerms,
                      by_params + e * in.count, by_theta + e * in.parameters, in.parameters));
  });
  return out;
}

}  // namespace granpinn
