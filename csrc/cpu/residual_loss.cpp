// granpinn::residual_loss on the CPU: loss terms and all gradients in one pass over the tiles.
#include "ops.h"
#include "threads.h"

namespace granpinn {

namespace {

struct LossTensors {
  Shared theta, points, velocity, point_weights, surface_points, surface_pressure, term_weights;
  Shared input_shift, input_scale, physics;
};

template <class T>
LossArguments<T> member_arguments(const T* params, Ints widths, Form form, const LossTensors& in,
                                  std::int64_t e) {
  LossArguments<T> a{};
  a.net = network(params, widths, in.input_shift.member<T>(e), in.input_scale.member<T>(e));
  a.form = form;
  a.physics = physics_from<T>(in.physics.member<T>(e));
  for (int i = 0; i < 3; ++i) a.theta[i] = in.theta.member<T>(e)[i];
  for (int i = 0; i < kTerms; ++i) a.term_weights[i] = in.term_weights.member<T>(e)[i];
  a.n = in.points.data.size(-2);
  a.m = in.surface_points.data.size(-2);
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

std::tuple<at::Tensor, at::Tensor, at::Tensor, at::Tensor> residual_loss_cpu(
    const at::Tensor& params, const at::Tensor& theta, const at::Tensor& points,
    const at::Tensor& velocity, const at::Tensor& point_weights, const at::Tensor& surface_points,
    const at::Tensor& surface_pressure, const at::Tensor& term_weights, Ints widths,
    const at::Tensor& input_shift, const at::Tensor& input_scale, const at::Tensor& physics,
    c10::string_view form, c10::string_view precision) {
  const std::int64_t count = parameter_count(widths);
  fast_precision(precision);
  check_physics(physics.size(-1));
  const std::int64_t E = ensemble_size(params, count), members = E ? E : 1;
  const Form kind = form_of(form);
  const std::int64_t K = widths.back();
  TORCH_CHECK_VALUE(kind == Form::mixed    ? K == 5
                    : kind == Form::strong ? K == 3
                                           : K == 3 || K == 5,
                    "the ", form, " form takes a network with ",
                    kind == Form::mixed    ? "5"
                    : kind == Form::strong ? "3"
                                           : "3 or 5",
                    " outputs, got widths ", widths);
  const Shared x = shared("points", points, params, E, {-1, 3});
  const Shared xs = shared("surface_points", surface_points, params, E, {-1, 3});
  const std::int64_t N = points.size(-2), M = surface_points.size(-2);
  const LossTensors in{shared("theta", theta, params, E, {3}),
                       x,
                       shared("velocity", velocity, params, E, {N, 2}),
                       shared("point_weights", point_weights, params, E, {N, 2}),
                       xs,
                       shared("surface_pressure", surface_pressure, params, E, {M}),
                       shared("term_weights", term_weights, params, E, {kTerms}),
                       shared("input_shift", input_shift, params, E, {3}),
                       shared("input_scale", input_scale, params, E, {3}),
                       shared("physics", physics, params, E, {kPhysics})};
  const at::Tensor flat = params.contiguous();
  const auto leading = [&](std::vector<std::int64_t> shape) {
    if (E) shape.insert(shape.begin(), E);
    return at::empty(shape, params.options());
  };
  at::Tensor loss = leading({}), terms = leading({kTerms});
  at::Tensor grad_params = leading({count}), grad_theta = leading({3});
  AT_DISPATCH_FLOATING_TYPES(params.scalar_type(), "residual_loss", [&] {
    for (std::int64_t e = 0; e < members; ++e) {
      const scalar_t* own = flat.const_data_ptr<scalar_t>() + e * count;
      loss.mutable_data_ptr<scalar_t>()[e] =
          static_cast<scalar_t>(member_loss(member_arguments(own, widths, kind, in, e),
                                            terms.mutable_data_ptr<scalar_t>() + e * kTerms,
                                            grad_params.mutable_data_ptr<scalar_t>() + e * count,
                                            grad_theta.mutable_data_ptr<scalar_t>() + e * 3));
    }
  });
  return {loss, terms, grad_params, grad_theta};
}

}  // namespace granpinn
