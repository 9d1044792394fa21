// The operators of one optimization step: checks, and the structs for the backends.
//
// `Backend` runs each struct: draw(a), loss(in), update(a), and descend(a, G, precision) with the
// matrices G that it orthogonalizes. The operators change the tensors that the schemas mark, and
// synchronise nothing.
#pragma once

#include <c10/core/DeviceGuard.h>
#include <tuple>

#include "../batch.h"
#include "residual_loss.h"

namespace granpinn {

// Checks the type, the shape and the device (the same as `like`) of a tensor that is used in place.
inline void expect(const char* name, const at::Tensor& a, at::ScalarType type,
                   const at::Tensor& like, std::vector<std::int64_t> shape) {
  const at::IntArrayRef expected(shape);
  GRANPINN_CHECK_TYPE(a.scalar_type() == type && a.device() == like.device(), name, " must be ",
                      c10::toString(type), " on ", like.device().str(), ", got ", shape_of(a));
  GRANPINN_CHECK_VALUE(a.sizes() == expected && a.is_contiguous(), name, " must be ", expected,
                       " and contiguous, got ", shape_of(a));
}

inline Control control_of(const at::Tensor& counter, const at::Tensor& table, std::int64_t E) {
  expect("counter", counter, at::kLong, counter, {3});
  GRANPINN_CHECK_VALUE(table.dim() == 2 && table.size(0) >= 1, "table must be [rows, ", 2 + E,
                       "] with at least one row, got ", shape_of(table));
  expect("table", table, at::kDouble, counter, {table.size(0), 2 + E});
  return {counter.mutable_data_ptr<std::int64_t>(), table.const_data_ptr<double>(), table.size(0),
          E};
}

inline Members members_of(const at::Tensor& lr_scale, const at::Tensor& fault,
                          const at::Tensor& counts, const at::Tensor& like, std::int64_t E) {
  expect("lr_scale", lr_scale, at::kDouble, like, {E});
  expect("fault", fault, at::kLong, like, {E});
  expect("counts", counts, at::kLong, like, {E, 2});
  return {lr_scale.const_data_ptr<double>(), fault.mutable_data_ptr<std::int64_t>(),
          counts.mutable_data_ptr<std::int64_t>()};
}

inline AdamSettings adam_settings(Doubles values) {
  GRANPINN_CHECK_VALUE(values.size() == 4,
                       "adam must be [learning_rate, beta_1, beta_2, epsilon], got ", values.size(),
                       " values");
  return {values[0], values[1], values[2], values[3]};
}

// A code of `Variable` for every parameter of a law, and the bounds (low, high) of its q.
inline LawVariables law_variables(Ints codes, Doubles bounds) {
  const std::size_t N = codes.size();
  GRANPINN_CHECK_VALUE(N >= 1 && N <= kMaxLawParameters && bounds.size() == 2 * N,
                       "variables must be 1 to ", kMaxLawParameters,
                       " codes with two bounds each, got ", N, " and ", bounds.size(), " bounds");
  LawVariables v{};
  v.parameters = static_cast<int>(N);
  for (std::size_t k = 0; k < N; ++k) {
    GRANPINN_CHECK_VALUE(codes[k] >= 0 && codes[k] < kVariables, "variables must be in 0..",
                         kVariables - 1, ", got ", codes);
    v.kind[k] = static_cast<Variable>(codes[k]);
    v.low[k] = bounds[2 * k];
    v.high[k] = bounds[2 * k + 1];
  }
  GRANPINN_CHECK_VALUE(v.kind[0] != Variable::logarithm_above,
                       "the first parameter of a law has no parameter below it, got ", codes);
  return v;
}

// [E, P] and the type of params.
inline std::pair<std::int64_t, std::int64_t> ensemble_of(const at::Tensor& params) {
  GRANPINN_CHECK_TYPE(params.scalar_type() == at::kFloat || params.scalar_type() == at::kDouble,
                      "params must be float32 or float64, got ", shape_of(params));
  GRANPINN_CHECK_VALUE(params.dim() == 2, "params must be [E, P], got ", shape_of(params));
  return {params.size(0), params.size(1)};
}

template <class Backend>
struct StepOps {
  using Six = std::tuple<at::Tensor, at::Tensor, at::Tensor, at::Tensor, at::Tensor, at::Tensor>;

  static Six draw_batch(const at::Tensor& counter, const at::Tensor& table, const at::Tensor& seeds,
                        const at::Tensor& places, const at::Tensor& points,
                        const at::Tensor& velocity, const at::Tensor& point_weights,
                        const at::Tensor& surface_points, const at::Tensor& surface_pressure,
                        const at::Tensor& term_weights, std::int64_t interior, std::int64_t surface,
                        std::int64_t share) {
    const c10::DeviceGuard guard(points.device());
    const std::int64_t E = seeds.numel(), N = points.size(0), M = surface_points.size(0);
    const at::ScalarType type = points.scalar_type();
    GRANPINN_CHECK_TYPE(type == at::kFloat || type == at::kDouble,
                        "points must be float32 or float64, got ", shape_of(points));
    expect("seeds", seeds, at::kLong, points, {E});
    expect("places", places, at::kLong, points, {E, 4});
    expect("points", points, type, points, {N, 3});
    expect("velocity", velocity, type, points, {N, 2});
    expect("point_weights", point_weights, type, points, {N, 2});
    expect("surface_points", surface_points, type, points, {M, 3});
    expect("surface_pressure", surface_pressure, type, points, {M});
    expect("term_weights", term_weights, type, points, {E, kTerms});
    GRANPINN_CHECK_VALUE(interior >= 0 && surface >= 0 && share >= 0,
                         "interior, surface and share must not be negative, got ", interior, ", ",
                         surface, " and ", share);
    GRANPINN_CHECK_VALUE((N > 0 || interior == 0) && (M > 0 || surface == 0),
                         "there must be points to draw from, got ", N, " and ", M,
                         " for batches of ", interior, " and ", surface);
    const auto empty = [&](std::vector<std::int64_t> shape) {
      return at::empty(shape, points.options());
    };
    const Six out{empty({E, interior, 3}), empty({E, interior, 2}), empty({E, interior, 2}),
                  empty({E, surface, 3}),  empty({E, surface}),     empty({E, kTerms})};
    const Control control = control_of(counter, table, E);
    AT_DISPATCH_FLOATING_TYPES(type, "draw_batch", [&] {
      using T = scalar_t;
      const auto data = [](const at::Tensor& a) { return a.const_data_ptr<T>(); };
      const auto to = [](const at::Tensor& a) { return a.mutable_data_ptr<T>(); };
      Backend::draw(BatchArguments<T>{
          control, interior, surface, share, seeds.const_data_ptr<std::int64_t>(),
          places.const_data_ptr<std::int64_t>(), data(points), data(velocity), data(point_weights),
          data(surface_points), data(surface_pressure), data(term_weights), to(std::get<0>(out)),
          to(std::get<1>(out)), to(std::get<2>(out)), to(std::get<3>(out)), to(std::get<4>(out)),
          to(std::get<5>(out))});
    });
    return out;
  }

  // residual_loss of the batch that draw_batch draws.
  static LossResult batch_loss(const at::Tensor& counter, const at::Tensor& table,
                               const at::Tensor& seeds, const at::Tensor& places,
                               const at::Tensor& points, const at::Tensor& velocity,
                               const at::Tensor& point_weights, const at::Tensor& surface_points,
                               const at::Tensor& surface_pressure, const at::Tensor& term_weights,
                               std::int64_t interior, std::int64_t surface, std::int64_t share,
                               const at::Tensor& params, const at::Tensor& theta, Ints widths,
                               const at::Tensor& input_shift, const at::Tensor& input_scale,
                               const at::Tensor& physics, c10::string_view form,
                               c10::string_view law, c10::string_view precision) {
    const Six batch =
        draw_batch(counter, table, seeds, places, points, velocity, point_weights, surface_points,
                   surface_pressure, term_weights, interior, surface, share);
    LossTensors in = std::apply(
        [&](const auto&... drawn) {
          return loss_tensors(params, theta, drawn..., widths, input_shift, input_scale, physics,
                              form, law, precision);
        },
        batch);
    in.drawn = in.E > 0 && in.params.is_same(params);
    return Backend::loss(in);
  }

  static void update(const at::Tensor& counter, const at::Tensor& table, const at::Tensor& lr_scale,
                     const at::Tensor& fault, const at::Tensor& counts, const at::Tensor& loss,
                     const at::Tensor& gradient, const at::Tensor& params, const at::Tensor& first,
                     const at::Tensor& second, const at::Tensor& direction,
                     const at::Tensor& average_params, Ints matrices, Doubles adam, double momentum,
                     const at::Tensor& grad_theta, const at::Tensor& q, const at::Tensor& first_q,
                     const at::Tensor& second_q, const at::Tensor& theta,
                     const at::Tensor& average_q, Doubles law_adam, Ints variables, Doubles bounds,
                     bool law_moves) {
    const c10::DeviceGuard guard(params.device());
    const auto [E, P] = ensemble_of(params);
    const at::ScalarType type = params.scalar_type();
    expect("params", params, type, params, {E, P});
    expect("loss", loss, type, params, {E});
    expect("gradient", gradient, type, params, {E, P});
    expect("first", first, type, params, {E, P});
    expect("second", second, type, params, {E, P});
    expect("direction", direction, type, params, {E, P});
    expect("average_params", average_params, type, params, {E, P});
    const LawVariables kinds = law_variables(variables, bounds);
    expect("grad_theta", grad_theta, type, params, {E, kinds.parameters});
    expect("q", q, type, params, {E, kinds.parameters});
    expect("first_q", first_q, type, params, {E, kinds.parameters});
    expect("second_q", second_q, type, params, {E, kinds.parameters});
    expect("theta", theta, type, params, {E, kinds.parameters});
    expect("average_q", average_q, type, params, {E, kinds.parameters});
    const auto regions = static_cast<int>(matrices.size() / 2);
    GRANPINN_CHECK_VALUE(matrices.size() % 2 == 0 && regions <= kMaxRegions,
                         "matrices must be (begin, size) of at most ", kMaxRegions,
                         " hidden matrices, got ", matrices.size(), " numbers");
    const Control control = control_of(counter, table, E);
    const Members members = members_of(lr_scale, fault, counts, params, E);
    AT_DISPATCH_FLOATING_TYPES(type, "update", [&] {
      using T = scalar_t;
      const auto at = [](const at::Tensor& a) { return a.mutable_data_ptr<T>(); };
      const LawArguments<T> law{adam_settings(law_adam),
                                kinds,
                                law_moves,
                                grad_theta.const_data_ptr<T>(),
                                at(q),
                                at(first_q),
                                at(second_q),
                                at(theta),
                                at(average_q)};
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
                           at(average_params),
                           law};
      std::int64_t end = 0;
      for (int i = 0; i < regions; ++i) {
        a.region[i] = {matrices[2 * i], matrices[2 * i + 1]};
        GRANPINN_CHECK_VALUE(a.region[i].begin >= end && a.region[i].size >= 0,
                             "matrices must be ascending and apart, got ", matrices);
        end = a.region[i].begin + a.region[i].size;
      }
      GRANPINN_CHECK_VALUE(end <= P, "matrices must end within ", P, " parameters, got ", matrices);
      Backend::update(a);
    });
  }

  static void descend(const at::Tensor& counter, const at::Tensor& table,
                      const at::Tensor& lr_scale, const at::Tensor& fault, const at::Tensor& counts,
                      const at::Tensor& G, const at::Tensor& params,
                      const at::Tensor& average_params, std::int64_t offset, std::int64_t apart,
                      double learning_rate, c10::string_view precision) {
    const c10::DeviceGuard guard(params.device());
    const auto [E, P] = ensemble_of(params);
    const at::ScalarType type = params.scalar_type();
    GRANPINN_CHECK_TYPE(G.scalar_type() == type && G.device() == params.device(),
                        "G must have the type and device of params, ", shape_of(params), ", got ",
                        shape_of(G));
    GRANPINN_CHECK_VALUE(G.dim() == 4 && G.size(0) == E, "G must be [", E, ", L, m, n], got ",
                         shape_of(G));
    const std::int64_t L = G.size(1), size = G.size(2) * G.size(3);
    expect("params", params, type, params, {E, P});
    expect("average_params", average_params, type, params, {E, P});
    GRANPINN_CHECK_VALUE(
        offset >= 0 && (L == 0 || (apart >= size && offset + (L - 1) * apart + size <= P)),
        "the matrices must lie apart within ", P, " parameters, got offset ", offset, ", apart ",
        apart, " and G ", shape_of(G));
    const Control control = control_of(counter, table, E);
    const Members members = members_of(lr_scale, fault, counts, params, E);
    fast_precision(precision);
    if (G.numel() == 0) return;
    AT_DISPATCH_FLOATING_TYPES(type, "descend", [&] {
      using T = scalar_t;
      Backend::descend(
          DescendArguments<T>{control, members, P, offset, L, size, apart, learning_rate, nullptr,
                              params.mutable_data_ptr<T>(), average_params.mutable_data_ptr<T>()},
          G, precision);
    });
  }
};

}  // namespace granpinn
