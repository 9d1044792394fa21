// granpinn::residual_loss on the CPU: loss terms and all gradients in one pass over the tiles.
#include "ops.h"
#include "threads.h"

namespace granpinn {

namespace {

template <class T>
LossArguments<T> member_arguments(const LossTensors& in, Ints widths, std::int64_t e) {
  const T* params = in.params.const_data_ptr<T>() + e * in.count;
  LossArguments<T> a{};
  a.net = network(params, widths, in.input_shift.member<T>(e), in.input_scale.member<T>(e));
  a.form = in.form;
  a.physics = physics_from<T>(in.physics.member<T>(e));
  for (int i = 0; i < 3; ++i) a.theta[i] = in.theta.member<T>(e)[i];
  for (int i = 0; i < kTerms; ++i) a.term_weights[i] = in.term_weights.member<T>(e)[i];
  a.n = in.n;
  a.m = in.m;
  a.points = in.points.member<T>(e);
  a.velocity = in.velocity.member<T>(e);
  a.point_weights = in.point_weights.member<T>(e);
  a.surface_points = in.surface_points.member<T>(e);
  a.surface_pressure = in.surface_pressure.member<T>(e);
  return a;
}

// One member: terms [5], gradients; returns the loss.
template <class T>
double member_loss(const LossArguments<T>& a, T* terms, T* grad_params, T* grad_theta) {
  const int C = a.form == Form::data ? 1 : a.form == Form::mixed ? 4 : 7;
  const std::int64_t interior = tiles_of(a.n), tiles = interior + tiles_of(a.m);
  const Team<T> team(a.net, C, tiles);
  std::vector<LossSums<T>> sums(team.size());
  // tiles of the surface are cheaper than those of the interior: each kind is split by itself
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
    const std::int64_t points = k == 1 ? a.m : a.n;
    const double term = points ? square / (2.0 * static_cast<double>(points)) : 0.0;
    terms[k] = static_cast<T>(term);
    loss += static_cast<double>(a.term_weights[k]) * term;
  }
  for (int i = 0; i < 3; ++i) {
    double sum = 0;
    for (const auto& s : sums) sum += s.theta[i];
    grad_theta[i] = static_cast<T>(sum);
  }
  return loss;
}

}  // namespace

LossResult residual_loss_cpu(const at::Tensor& params, const at::Tensor& theta,
                             const at::Tensor& points, const at::Tensor& velocity,
                             const at::Tensor& point_weights, const at::Tensor& surface_points,
                             const at::Tensor& surface_pressure, const at::Tensor& term_weights,
                             Ints widths, const at::Tensor& input_shift,
                             const at::Tensor& input_scale, const at::Tensor& physics,
                             c10::string_view form, c10::string_view precision) {
  const LossTensors in =
      loss_tensors(params, theta, points, velocity, point_weights, surface_points, surface_pressure,
                   term_weights, widths, input_shift, input_scale, physics, form, precision);
  const LossResult out = in.results();
  AT_DISPATCH_FLOATING_TYPES(params.scalar_type(), "residual_loss", [&] {
    auto* losses = std::get<0>(out).mutable_data_ptr<scalar_t>();
    auto* each_terms = std::get<1>(out).mutable_data_ptr<scalar_t>();
    auto* by_params = std::get<2>(out).mutable_data_ptr<scalar_t>();
    auto* by_theta = std::get<3>(out).mutable_data_ptr<scalar_t>();
    for (std::int64_t e = 0; e < in.members(); ++e)
      losses[e] = static_cast<scalar_t>(member_loss(member_arguments<scalar_t>(in, widths, e),
                                                    each_terms + e * kTerms,
                                                    by_params + e * in.count, by_theta + e * 3));
  });
  return out;
}

}  // namespace granpinn
