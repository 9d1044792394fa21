// granpinn::residual_loss: the arguments, checked, as one struct for the backends.
//
// `Backend::loss(in)` returns the LossResult of the checked tensors.
#pragma once

#include <optional>
#include <tuple>

#include "arguments.h"

namespace granpinn {

// loss, terms, grad_params, grad_theta
using LossResult = std::tuple<at::Tensor, at::Tensor, at::Tensor, at::Tensor>;

// Everything contiguous, of one type and on one device.
struct LossTensors {
  Form form;
  std::vector<LawName> laws;  // of all members, or one for each
  int parameters;             // of a row of theta: the most that a law has
  Ints widths;
  bool fast;              // precision
  bool drawn;             // draw_batch made the points just before, and no parameter has changed
  std::int64_t count, E;  // parameters; ensemble size, 0 without the axis
  std::int64_t n, m;      // interior and surface points
  at::Tensor params;
  Shared theta, points, velocity, point_weights, surface_points, surface_pressure, term_weights;
  Shared input_shift, input_scale, physics;
  Shared source;  // without data: none

  std::int64_t members() const { return E ? E : 1; }
  LawName law_of(std::int64_t e) const { return laws.size() == 1 ? laws[0] : laws[e]; }

  // The source term of member e, or null.
  template <class T>
  const T* source_of(std::int64_t e) const {
    return source.data.defined() ? source.member<T>(e) : nullptr;
  }

  // The result, with its memory not yet filled in.
  LossResult results() const {
    const auto leading = [&](std::vector<std::int64_t> shape) {
      if (E) shape.insert(shape.begin(), E);
      return at::empty(shape, params.options());
    };
    return {leading({}), leading({kTerms}), leading({count}), leading({parameters})};
  }
};

inline void check_outputs(Form form, c10::string_view name, Ints widths) {
  const std::int64_t K = widths.back();
  GRANPINN_CHECK_VALUE(form == Form::mixed    ? K == 5
                       : form == Form::strong ? K == 3
                                              : K == 3 || K == 5,
                       "the ", name, " form takes a network with ",
                       form == Form::mixed    ? "5"
                       : form == Form::strong ? "3"
                                              : "3 or 5",
                       " outputs, got widths ", widths);
}

inline LossTensors loss_tensors(const at::Tensor& params, const at::Tensor& theta,
                                const at::Tensor& points, const at::Tensor& velocity,
                                const at::Tensor& point_weights, const at::Tensor& surface_points,
                                const at::Tensor& surface_pressure, const at::Tensor& term_weights,
                                Ints widths, const at::Tensor& input_shift,
                                const at::Tensor& input_scale, const at::Tensor& physics,
                                c10::string_view form, c10::string_view law,
                                c10::string_view precision,
                                const std::optional<at::Tensor>& source) {
  LossTensors in{};
  in.count = parameter_count(widths);
  in.widths = widths;
  in.fast = fast_precision(precision);
  check_physics(physics.dim() > 0 ? physics.size(-1) : 1);
  in.E = ensemble_size(params, in.count);
  in.form = form_of(form);
  in.laws = laws_of(law);
  GRANPINN_CHECK_VALUE(in.laws.size() == 1 || static_cast<std::int64_t>(in.laws.size()) == in.E,
                       "law must be one name, or one for each of E = ", in.E,
                       " members with commas between them, got '", law, "'");
  for (const LawName name : in.laws) in.parameters = larger(in.parameters, parameters_of(name));
  check_outputs(in.form, form, widths);
  in.params = params.contiguous();
  const auto checked = [&](const char* name, const at::Tensor& a, std::vector<std::int64_t> shape) {
    return shared(name, a, params, in.E, std::move(shape));
  };
  in.points = checked("points", points, {-1, 3});
  in.surface_points = checked("surface_points", surface_points, {-1, 3});
  in.n = points.size(-2);
  in.m = surface_points.size(-2);
  in.theta = checked("theta", theta, {in.parameters});
  in.velocity = checked("velocity", velocity, {in.n, 2});
  in.point_weights = checked("point_weights", point_weights, {in.n, 2});
  if (source) in.source = checked("source", *source, {in.n, 2});
  in.surface_pressure = checked("surface_pressure", surface_pressure, {in.m});
  in.term_weights = checked("term_weights", term_weights, {kTerms});
  in.input_shift = checked("input_shift", input_shift, {3});
  in.input_scale = checked("input_scale", input_scale, {3});
  in.physics = checked("physics", physics, {kPhysics});
  if (physics.is_cpu())  // on a GPU the check would wait for it
    AT_DISPATCH_FLOATING_TYPES(params.scalar_type(), "physics", [&] {
      for (std::int64_t e = 0; e < in.members(); ++e)
        sound(physics_from<scalar_t>(in.physics.member<scalar_t>(e)));
    });
  return in;
}

// The operator for a backend, with the arguments of loss_tensors.
template <class Backend, class Parser = decltype(loss_tensors)>
struct ResidualLoss;
template <class Backend, class... Arguments>
struct ResidualLoss<Backend, LossTensors(Arguments...)> {
  static LossResult evaluate(Arguments... arguments) {
    return Backend::loss(loss_tensors(arguments...));
  }
};

}  // namespace granpinn
