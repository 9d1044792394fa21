// From raw outputs at the points of a chunk to their adjoints, and the sums of the loss.
//
// raw and g are [members][C][count][fields]; a block writes its sums into row `blockIdx.x` of its
// member's partial sums [blocks][kSums]: kTerms sums of weighted squares, then gradients by theta.
#pragma once

#include "block_sum.cuh"
#include "layered.h"
#include "math/forms/mixed.h"
#include "math/forms/strong.h"

namespace granpinn::cuda {

constexpr int kMisfitThreads = 128;

template <class T>
__device__ double weighted_square(T weight, T e) {
  return static_cast<double>(weight) * static_cast<double>(e) * static_cast<double>(e);
}

// The velocity misfit of point i in component k: returns its adjoint, adds its weighted square.
template <class T>
__device__ T velocity_misfit(const DeviceLoss<T>& a, std::int64_t e, std::int64_t i, int k, T raw,
                             double* square) {
  const T scale = physics_from<T>(a.physics.member(e)).scale_of(k);
  const T factor = a.term_weights.member(e)[kVelocity] / static_cast<T>(a.n) * scale;
  const T weight = a.point_weights.member(e)[2 * i];
  const T misfit = scale * raw - a.velocity.member(e)[2 * i + k];
  *square += weighted_square(weight, misfit);
  return factor * weight * misfit;
}

// Interior points: one thread for each.
template <class F, class T>
__global__ __launch_bounds__(kMisfitThreads) void interior_adjoint(
    const __grid_constant__ DeviceLoss<T> a, Chunk chunk, const T* raw, T* g, double* sums) {
  constexpr int C = F::channels, K = F::fields;
  const std::int64_t p = static_cast<std::int64_t>(blockIdx.x) * kMisfitThreads + threadIdx.x;
  const std::int64_t e = chunk.first_member + blockIdx.z, i = chunk.begin + p;
  double own[kSums] = {};
  if (p < chunk.count) {
    const auto at = [&](int k, int c) { return ((blockIdx.z * C + c) * chunk.count + p) * K + k; };
    T z[K][C], z_a[K][C], w[F::residuals], residual[F::residuals];
    T theta[kMaxLawParameters] = {}, theta_a[kMaxLawParameters] = {};
    for (int k = 0; k < K; ++k)
      for (int c = 0; c < C; ++c) z[k][c] = raw[at(k, c)];
    const T* term_weights = a.term_weights.member(e);
    for (int k = 0; k < a.parameters; ++k) theta[k] = a.theta.member(e)[k];
    const T weight = a.point_weights.member(e)[2 * i + 1];
    for (int r = 0; r < F::residuals; ++r)
      w[r] = term_weights[F::term_of(r)] / static_cast<T>(a.n) * weight;
    const Physics<T> physics = physics_from<T>(a.physics.member(e));
    const BodyForce<T> force = body_force(physics, a.source.member(e), i);
    visit_law(a.law_of(e), [&](auto law) {
      F::template gradient<decltype(law)>(z, theta, physics, force, w, residual, z_a, theta_a);
    });
    for (int k = 0; k < 2; ++k) z_a[k][0] += velocity_misfit(a, e, i, k, z[k][0], &own[kVelocity]);
    for (int k = 0; k < K; ++k)
      for (int c = 0; c < C; ++c) g[at(k, c)] = z_a[k][c];
    for (int r = 0; r < F::residuals; ++r)
      own[F::term_of(r)] += weighted_square(weight, residual[r]);
    for (int k = 0; k < kMaxLawParameters; ++k) own[kTerms + k] = static_cast<double>(theta_a[k]);
  }
  double* to = sums + (blockIdx.z * gridDim.x + blockIdx.x) * kSums;
  for (int s = 0; s < kSums; ++s) {
    const double sum = s < kTerms + a.parameters ? block_sum<kMisfitThreads>(own[s]) : 0.0;
    if (threadIdx.x == 0) to[s] = sum;
  }
}

// Values alone: one thread for each point. The velocity misfit of the data form, or the pressure at
// the surface.
enum class Target { velocity, linear_pressure, softplus_pressure };

template <PressureMap map, class T>
__device__ T pressure_misfit(const DeviceLoss<T>& a, std::int64_t e, std::int64_t i, T raw,
                             double* square) {
  const T scale = physics_from<T>(a.physics.member(e)).pressure_scale;
  const T factor = a.term_weights.member(e)[kSurface] / static_cast<T>(a.m);
  const T misfit = pressure_value<map>(raw, scale) - a.surface_pressure.member(e)[i];
  *square += weighted_square(T(1), misfit);
  return factor * misfit * pressure_slope<map>(raw, scale);
}

template <Target target, class T>
__global__ __launch_bounds__(kMisfitThreads) void value_adjoint(
    const __grid_constant__ DeviceLoss<T> a, Chunk chunk, const T* raw, T* g, double* sums) {
  constexpr int term = target == Target::velocity ? kVelocity : kSurface;
  const std::int64_t p = static_cast<std::int64_t>(blockIdx.x) * kMisfitThreads + threadIdx.x;
  const std::int64_t K = a.net.outputs(), e = chunk.first_member + blockIdx.z;
  const std::int64_t i = chunk.begin + p;
  double square = 0;
  if (p < chunk.count) {
    const T* z = raw + (blockIdx.z * chunk.count + p) * K;
    T* adjoint = g + (blockIdx.z * chunk.count + p) * K;
    for (std::int64_t k = 0; k < K; ++k) adjoint[k] = T(0);
    if constexpr (target == Target::velocity) {
      for (int k = 0; k < 2; ++k) adjoint[k] = velocity_misfit(a, e, i, k, z[k], &square);
    } else {
      constexpr PressureMap map =
          target == Target::softplus_pressure ? PressureMap::softplus : PressureMap::linear;
      adjoint[2] = pressure_misfit<map>(a, e, i, z[2], &square);
    }
  }
  double* to = sums + (blockIdx.z * gridDim.x + blockIdx.x) * kSums;
  const double sum = block_sum<kMisfitThreads>(square);
  if (threadIdx.x == 0)
    for (int s = 0; s < kSums; ++s) to[s] = s == term ? sum : 0.0;
}

}  // namespace granpinn::cuda
