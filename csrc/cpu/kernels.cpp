// The CPU kernels, compiled once for every instruction set (see CMakeLists.txt).
//
// Use only always-inline templates and code of this namespace here. The linker may share any other
// function between objects, and then a processor would run instructions that it lacks.
#include "kernel_table.h"

#include "math/forms/mixed.h"
#include "math/forms/strong.h"
#include "mlp_tile.h"
#include "orthogonalize.h"
#include "pointwise.h"

namespace granpinn {
namespace GRANPINN_SIMD_NAMESPACE {

template <int C, class T>
void jet(const Network<T>& net, const T* points, std::int64_t begin, std::int64_t end,
         std::int64_t n, T* out, T* workspace) {
  const TileBuffers<T> tile(net, C, workspace);
  const std::int64_t K = net.outputs();
  for (std::int64_t at = begin; at < end; at += kTile) {
    load_points(net, points, at, end, tile.xi);
    const T* raw = forward<C>(net, tile);
    const std::int64_t count = end - at < kTile ? end - at : kTile;
    for (int c = 0; c < C; ++c)
      for (std::int64_t p = 0; p < count; ++p)
        for (std::int64_t k = 0; k < K; ++k)
          out[(c * n + at + p) * K + k] = raw[(c * K + k) * kTile + p];
  }
}

template <int C, class T>
void jet_adjoint(const Network<T>& net, const T* points, std::int64_t begin, std::int64_t end,
                 std::int64_t n, const T* grad_out, GradientSum<T>* gradient, T* workspace) {
  const TileBuffers<T> tile(net, C, workspace);
  const std::int64_t K = net.outputs();
  for (std::int64_t at = begin; at < end; at += kTile) {
    load_points(net, points, at, end, tile.xi);
    forward<C>(net, tile);
    const std::int64_t count = end - at < kTile ? end - at : kTile;
    for (int c = 0; c < C; ++c)
      for (std::int64_t k = 0; k < K; ++k)
        for (std::int64_t p = 0; p < kTile; ++p)
          tile.g[(c * K + k) * kTile + p] = p < count ? grad_out[(c * n + at + p) * K + k] : T(0);
    backward<C>(net, tile, tile.g, gradient->block);
    gradient->tile_done();
  }
}

// Values of a tile's points, [count] apart by `stride`, with zeros behind the last point.
template <class T>
void load_column(const T* from, std::int64_t stride, std::int64_t count, T (&column)[kTile]) {
  for (int p = 0; p < kTile; ++p) column[p] = p < count ? from[p * stride] : T(0);
}

template <class T, class V>
double weighted_square(V weight, V e) {
  double sum = 0;
  for (int i = 0; i < kLanes<T>; ++i)
    sum += static_cast<double>(weight.v[i]) * static_cast<double>(e.v[i]) * e.v[i];
  return sum;
}

// The body force at a tile's points.
template <class T>
void load_force(const LossArguments<T>& a, std::int64_t at, std::int64_t count, T (&x)[kTile],
                T (&y)[kTile]) {
  for (int p = 0; p < kTile; ++p) {
    const BodyForce<T> force = body_force(a.physics, p < count ? a.source : nullptr, at + p);
    x[p] = force.x;
    y[p] = force.y;
  }
}

// The data misfit of one tile: adds to the adjoint of the raw outputs' values.
template <class T>
void velocity_misfit(const LossArguments<T>& a, const T* raw, const T (&w)[kTile], std::int64_t at,
                     std::int64_t count, T* g, double* square) {
  using V = Vec<T>;
  for (int k = 0; k < 2; ++k) {
    alignas(64) T target[kTile];
    load_column(a.velocity + 2 * at + k, 2, count, target);
    const T scale = a.physics.scale_of(k);
    const T factor = a.term_weights[kVelocity] / static_cast<T>(a.n) * scale;
    for (int p = 0; p < kTile; p += kLanes<T>) {
      const V weight = V::load(w + p);
      const V e = V(scale) * V::load(raw + k * kTile + p) - V::load(target + p);
      *square += weighted_square<T>(weight, e);
      (V::load(g + k * kTile + p) + V(factor) * weight * e).store(g + k * kTile + p);
    }
  }
}

// An interior tile: velocity misfit and, where the form has them, the equations.
template <class F, class Law, class T>
void interior_tile(const LossArguments<T>& a, const TileBuffers<T>& tile, std::int64_t at,
                   LossSums<T>* sums) {
  using V = Vec<T>;
  const std::int64_t K = F::fields, count = a.n - at < kTile ? a.n - at : kTile;
  load_points(a.net, a.points, at, a.n, tile.xi);
  const T* raw = forward<F::channels>(a.net, tile);
  alignas(64) T w_velocity[kTile], w_physics[kTile], force_x[kTile], force_y[kTile];
  load_column(a.point_weights + 2 * at, 2, count, w_velocity);
  load_column(a.point_weights + 2 * at + 1, 2, count, w_physics);
  load_force(a, at, count, force_x, force_y);
  const LawValues<Law, T> law(a.theta);
  for (int p = 0; p < kTile; p += kLanes<T>) {
    V z[F::fields][F::channels], g[F::fields][F::channels];
    V w[F::residuals], e[F::residuals], g_theta[Law::parameters];
    for (int k = 0; k < F::fields; ++k)
      for (int c = 0; c < F::channels; ++c) z[k][c] = V::load(raw + (c * K + k) * kTile + p);
    const V weight = V::load(w_physics + p);
    for (int r = 0; r < F::residuals; ++r)
      w[r] = V(a.term_weights[F::term_of(r)] / static_cast<T>(a.n)) * weight;
    const BodyForce<V> force{V::load(force_x + p), V::load(force_y + p)};
    F::template gradient<Law>(z, law.theta, a.physics, force, w, e, g, g_theta);
    for (int k = 0; k < F::fields; ++k)
      for (int c = 0; c < F::channels; ++c) g[k][c].store(tile.g + (c * K + k) * kTile + p);
    for (int r = 0; r < F::residuals; ++r)
      sums->squares[F::term_of(r)] += weighted_square<T>(weight, e[r]);
    for (int i = 0; i < Law::parameters; ++i)
      sums->theta[i] += static_cast<double>(g_theta[i].sum());
  }
  velocity_misfit(a, raw, w_velocity, at, count, tile.g, &sums->squares[kVelocity]);
  backward<F::channels>(a.net, tile, tile.g, sums->gradient.block);
}

template <class T>
void data_tile(const LossArguments<T>& a, const TileBuffers<T>& tile, std::int64_t at,
               LossSums<T>* sums) {
  const std::int64_t K = a.net.outputs(), count = a.n - at < kTile ? a.n - at : kTile;
  load_points(a.net, a.points, at, a.n, tile.xi);
  const T* raw = forward<1>(a.net, tile);
  alignas(64) T w_velocity[kTile];
  load_column(a.point_weights + 2 * at, 2, count, w_velocity);
  for (std::int64_t i = 0; i < K * kTile; ++i) tile.g[i] = T(0);
  velocity_misfit(a, raw, w_velocity, at, count, tile.g, &sums->squares[kVelocity]);
  backward<1>(a.net, tile, tile.g, sums->gradient.block);
}

// A surface tile: the pressure there.
template <PressureMap map, class T>
void surface_tile(const LossArguments<T>& a, const TileBuffers<T>& tile, std::int64_t at,
                  LossSums<T>* sums) {
  using V = Vec<T>;
  const std::int64_t K = a.net.outputs(), count = a.m - at < kTile ? a.m - at : kTile;
  load_points(a.net, a.surface_points, at, a.m, tile.xi);
  const T* raw = forward<1>(a.net, tile);
  alignas(64) T target[kTile], w[kTile];
  load_column(a.surface_pressure + at, 1, count, target);
  for (int p = 0; p < kTile; ++p) w[p] = p < count ? T(1) : T(0);
  for (std::int64_t i = 0; i < K * kTile; ++i) tile.g[i] = T(0);
  const T factor = a.term_weights[kSurface] / static_cast<T>(a.m);
  for (int p = 0; p < kTile; p += kLanes<T>) {
    const V z = V::load(raw + 2 * kTile + p), weight = V::load(w + p);
    const V e = pressure_value<map>(z, a.physics.pressure_scale) - V::load(target + p);
    sums->squares[kSurface] += weighted_square<T>(weight, e);
    (V(factor) * weight * e * pressure_slope<map>(z, a.physics.pressure_scale))
        .store(tile.g + 2 * kTile + p);
  }
  backward<1>(a.net, tile, tile.g, sums->gradient.block);
}

template <class T>
void loss(const LossArguments<T>& a, std::int64_t begin, std::int64_t end, LossSums<T>* sums,
          T* workspace) {
  const std::int64_t interior = (a.n + kTile - 1) / kTile;
  for (std::int64_t i = begin; i < end; ++i) {
    const bool inside = i < interior;
    const int C = inside ? channels_of(a.form) : 1;
    const TileBuffers<T> tile(a.net, C, workspace);
    const std::int64_t at = (inside ? i : i - interior) * kTile;
    if (!inside && a.net.outputs() == MixedForm::fields)
      surface_tile<PressureMap::softplus>(a, tile, at, sums);
    else if (!inside)
      surface_tile<PressureMap::linear>(a, tile, at, sums);
    else if (a.form == Form::data)
      data_tile(a, tile, at, sums);
    else
      visit_law(a.law, [&](auto law) {
        using Law = decltype(law);
        if (a.form == Form::mixed)
          interior_tile<MixedForm, Law>(a, tile, at, sums);
        else
          interior_tile<StrongForm<PressureMap::linear>, Law>(a, tile, at, sums);
      });
    sums->gradient.tile_done();
  }
}

template <class T>
void any_jet(const Network<T>& net, int channels, const T* points, std::int64_t begin,
             std::int64_t end, std::int64_t n, T* out, T* workspace) {
  if (channels == 1) jet<1>(net, points, begin, end, n, out, workspace);
  if (channels == 4) jet<4>(net, points, begin, end, n, out, workspace);
  if (channels == 7) jet<7>(net, points, begin, end, n, out, workspace);
}

template <class T>
void any_jet_adjoint(const Network<T>& net, int channels, const T* points, std::int64_t begin,
                     std::int64_t end, std::int64_t n, const T* grad_out, GradientSum<T>* gradient,
                     T* workspace) {
  if (channels == 1) jet_adjoint<1>(net, points, begin, end, n, grad_out, gradient, workspace);
  if (channels == 4) jet_adjoint<4>(net, points, begin, end, n, grad_out, gradient, workspace);
  if (channels == 7) jet_adjoint<7>(net, points, begin, end, n, grad_out, gradient, workspace);
}

#define GRANPINN_STRING_(a) #a
#define GRANPINN_STRING(a) GRANPINN_STRING_(a)

template <class T>
constexpr KernelTable<T> kTable = {GRANPINN_STRING(GRANPINN_SIMD_NAMESPACE),
                                   any_jet<T>,
                                   any_jet_adjoint<T>,
                                   loss<T>,
                                   residuals<T>,
                                   viscosity_values<T>,
                                   viscosity_gradient<T>,
                                   orthogonalize<T>};

const KernelTable<float>& table_float() { return kTable<float>; }
const KernelTable<double>& table_double() { return kTable<double>; }

}  // namespace GRANPINN_SIMD_NAMESPACE
}  // namespace granpinn
