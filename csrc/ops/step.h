// The operators of one optimization step: checks, and the structs for the backends.
//
// `Backend` runs each struct: draw(a), loss(in), update(a), and descend(a, G, precision) with the
// matrices G that it orthogonalizes. The operators change the tensors that the schemas mark, and
// synchronise nothing.
#pragma once

#include <c10/core/DeviceGuard.h>
#include <algorithm>
#include <optional>
#include <tuple>

#include "residual_loss.h"
#include "step_arguments.h"

namespace granpinn {

template <class Backend>
struct StepOps {
  // points, velocity, point_weights, surface_points, surface_pressure, term_weights, source
  using Drawn = std::tuple<at::Tensor, at::Tensor, at::Tensor, at::Tensor, at::Tensor, at::Tensor,
                           at::Tensor>;

  static Drawn draw_batch(const at::Tensor& counter, const at::Tensor& table,
                          const at::Tensor& seeds, const at::Tensor& places,
                          const at::Tensor& points, const at::Tensor& velocity,
                          const at::Tensor& point_weights, const at::Tensor& surface_points,
                          const at::Tensor& surface_pressure, const at::Tensor& term_weights,
                          std::int64_t interior, std::int64_t surface,
                          const std::optional<at::Tensor>& source) {
    const c10::DeviceGuard guard(points.device());
    const at::ScalarType type = points.scalar_type();
    GRANPINN_CHECK_TYPE(type == at::kFloat || type == at::kDouble,
                        "points must be float32 or float64, got ", shape_of(points));
    GRANPINN_CHECK_VALUE(points.dim() == 2 && surface_points.dim() == 2,
                         "points and surface_points must be [N, 3] and [M, 3], got ",
                         shape_of(points), " and ", shape_of(surface_points));
    const std::int64_t E = seeds.numel(), N = points.size(0), M = surface_points.size(0);
    InPlace tensors(points);
    tensors.reads("seeds", seeds, at::kLong, {E});
    tensors.reads("places", places, at::kLong, {E, 4});
    tensors.reads("points", points, type, {N, 3});
    tensors.reads("velocity", velocity, type, {N, 2});
    tensors.reads("point_weights", point_weights, type, {N, 2});
    if (source) tensors.reads("source", *source, type, {N, 2});
    tensors.reads("surface_points", surface_points, type, {M, 3});
    tensors.reads("surface_pressure", surface_pressure, type, {M});
    tensors.reads("term_weights", term_weights, type, {E, kTerms});
    constexpr std::int64_t most = 1ll << 32;
    GRANPINN_CHECK_VALUE(interior >= 0 && interior <= most && surface >= 0 && surface <= most,
                         "interior and surface must be in [0, 2^32], got ", interior, " and ",
                         surface);
    GRANPINN_CHECK_VALUE((N > 0 || interior == 0) && (M > 0 || surface == 0),
                         "there must be points to draw from, got ", N, " and ", M,
                         " for batches of ", interior, " and ", surface);
    if (interior > 0) check_places("points", places, 0, N);
    if (surface > 0) check_places("surface points", places, 2, M);
    const Control control = control_of(tensors, counter, table, E, false);
    const auto empty = [&](std::vector<std::int64_t> shape) {
      return at::empty(shape, points.options());
    };
    const Drawn out{empty({E, interior, 3}),
                    empty({E, interior, 2}),
                    empty({E, interior, 2}),
                    empty({E, surface, 3}),
                    empty({E, surface}),
                    empty({E, kTerms}),
                    empty({E, source ? interior : 0, 2})};
    AT_DISPATCH_FLOATING_TYPES(type, "draw_batch", [&] {
      using T = scalar_t;
      const auto data = [](const at::Tensor& a) { return a.const_data_ptr<T>(); };
      const auto to = [](const at::Tensor& a) { return a.mutable_data_ptr<T>(); };
      Backend::draw(BatchArguments<T>{control,
                                      N,
                                      M,
                                      interior,
                                      surface,
                                      seeds.const_data_ptr<std::int64_t>(),
                                      places.const_data_ptr<std::int64_t>(),
                                      data(points),
                                      data(velocity),
                                      data(point_weights),
                                      data(surface_points),
                                      data(surface_pressure),
                                      data(term_weights),
                                      source ? data(*source) : nullptr,
                                      to(std::get<0>(out)),
                                      to(std::get<1>(out)),
                                      to(std::get<2>(out)),
                                      to(std::get<3>(out)),
                                      to(std::get<4>(out)),
                                      to(std::get<5>(out)),
                                      source ? to(std::get<6>(out)) : nullptr});
    });
    return out;
  }

  // residual_loss of the batch that draw_batch draws.
  static LossResult batch_loss(const at::Tensor& counter, const at::Tensor& table,
                               const at::Tensor& seeds, const at::Tensor& places,
                               const at::Tensor& points, const at::Tensor& velocity,
                               const at::Tensor& point_weights, const at::Tensor& surface_points,
                               const at::Tensor& surface_pressure, const at::Tensor& term_weights,
                               std::int64_t interior, std::int64_t surface,
                               const at::Tensor& params, const at::Tensor& theta, Ints widths,
                               const at::Tensor& input_shift, const at::Tensor& input_scale,
                               const at::Tensor& physics, c10::string_view form,
                               c10::string_view law, c10::string_view precision,
                               const std::optional<at::Tensor>& source) {
    const auto [x, v, w, surface_x, surface_p, weights, drawn_source] =
        draw_batch(counter, table, seeds, places, points, velocity, point_weights, surface_points,
                   surface_pressure, term_weights, interior, surface, source);
    LossTensors in = loss_tensors(params, theta, x, v, w, surface_x, surface_p, weights, widths,
                                  input_shift, input_scale, physics, form, law, precision,
                                  source ? std::optional(drawn_source) : std::nullopt);
    in.drawn = in.E > 0 && in.params.is_same(params);
    return Backend::loss(in);
  }

  static void update(const at::Tensor& counter, const at::Tensor& table, const at::Tensor& lr_scale,
                     const at::Tensor& fault, const at::Tensor& counts, const at::Tensor& loss,
                     const at::Tensor& gradient, const at::Tensor& params, const at::Tensor& first,
                     const at::Tensor& second, const at::Tensor& direction, Ints matrices,
                     Doubles adam, double momentum, const at::Tensor& grad_theta,
                     const at::Tensor& q, const at::Tensor& first_q, const at::Tensor& second_q,
                     const at::Tensor& theta, Doubles law_adam, const at::Tensor& variables,
                     const at::Tensor& bounds, bool law_moves) {
    const c10::DeviceGuard guard(params.device());
    const auto sizes = ensemble_of(params);  // not as [E, P]: Clang's OpenMP cannot capture those
    const std::int64_t E = sizes.first, P = sizes.second;
    const at::ScalarType type = params.scalar_type();
    InPlace tensors(params);
    tensors.changes("params", params, type, {E, P});
    tensors.reads("loss", loss, type, {E});
    tensors.reads("gradient", gradient, type, {E, P});
    tensors.changes("first", first, type, {E, P});
    tensors.changes("second", second, type, {E, P});
    tensors.changes("direction", direction, type, {E, P});
    const std::int64_t N = check_law_variables(variables, bounds);
    tensors.reads("variables", variables, at::kLong, {E, N});
    tensors.reads("bounds", bounds, at::kDouble, {E, N, 2});
    tensors.reads("grad_theta", grad_theta, type, {E, N});
    tensors.changes("q", q, type, {E, N});
    tensors.changes("first_q", first_q, type, {E, N});
    tensors.changes("second_q", second_q, type, {E, N});
    tensors.changes("theta", theta, type, {E, N});
    GRANPINN_CHECK_VALUE(finite(momentum), "momentum must be finite, got ", momentum);
    Region region[kMaxRegions] = {};
    const int regions = regions_of(matrices, P, region);
    const Control control = control_of(tensors, counter, table, E, true);
    check_step(control, counter);
    const Members members = members_of(tensors, lr_scale, fault, counts, E, true);
    tensors.are_apart();
    AT_DISPATCH_FLOATING_TYPES(type, "update", [&] {
      using T = scalar_t;
      const auto at = [](const at::Tensor& a) { return a.mutable_data_ptr<T>(); };
      const LawArguments<T> law{adam_settings(law_adam),
                                static_cast<int>(N),
                                variables.const_data_ptr<std::int64_t>(),
                                bounds.const_data_ptr<double>(),
                                law_moves,
                                grad_theta.const_data_ptr<T>(),
                                at(q),
                                at(first_q),
                                at(second_q),
                                at(theta)};
      UpdateArguments<T> a{control,
                           members,
                           P,
                           adam_settings(adam),
                           momentum,
                           regions,
                           {},
                           loss.const_data_ptr<T>(),
                           gradient.const_data_ptr<T>(),
                           at(params),
                           at(first),
                           at(second),
                           at(direction),
                           law};
      std::copy_n(region, regions, a.region);
      Backend::update(a);
    });
  }

  static void descend(const at::Tensor& counter, const at::Tensor& table,
                      const at::Tensor& lr_scale, const at::Tensor& fault, const at::Tensor& counts,
                      const at::Tensor& G, const at::Tensor& params, std::int64_t offset,
                      std::int64_t apart, double learning_rate, c10::string_view precision) {
    const c10::DeviceGuard guard(params.device());
    const auto sizes = ensemble_of(params);
    const std::int64_t E = sizes.first, P = sizes.second;
    const at::ScalarType type = params.scalar_type();
    GRANPINN_CHECK_TYPE(G.scalar_type() == type && G.device() == params.device(),
                        "G must have the type and device of params, ", shape_of(params), ", got ",
                        shape_of(G));
    GRANPINN_CHECK_VALUE(G.dim() == 4 && G.size(0) == E, "G must be [", E, ", L, m, n], got ",
                         shape_of(G));
    const std::int64_t L = G.size(1), size = checked_mul(G.size(2), G.size(3));
    InPlace tensors(params);
    tensors.changes("params", params, type, {E, P});
    tensors.spans("G", G, false);
    GRANPINN_CHECK_VALUE(
        offset >= 0 &&
            (L == 0 ||
             (apart >= size && within(offset, checked_add(checked_mul(L - 1, apart), size), P))),
        "the matrices must lie apart within ", P, " parameters, got offset ", offset, ", apart ",
        apart, " and G ", shape_of(G));
    GRANPINN_CHECK_VALUE(finite(learning_rate), "learning_rate must be finite, got ",
                         learning_rate);
    const Control control = control_of(tensors, counter, table, E, false);
    check_step(control, counter);
    const Members members = members_of(tensors, lr_scale, fault, counts, E, false);
    tensors.are_apart();
    fast_precision(precision);
    if (G.numel() == 0) return;
    AT_DISPATCH_FLOATING_TYPES(type, "descend", [&] {
      using T = scalar_t;
      Backend::descend(DescendArguments<T>{control, members, P, offset, L, size, apart,
                                           learning_rate, nullptr, params.mutable_data_ptr<T>()},
                       G, precision);
    });
  }
};

}  // namespace granpinn
