// From the raw outputs of a tile to their adjoints and the terms of the loss.
#pragma once

#include <type_traits>

#include "math/forms/mixed.h"
#include "math/forms/strong.h"
#include "tile.cuh"

namespace granpinn::cuda::fused {

// Constants of a member.
struct TaskConstants {
  float term_weights[kTerms];
  float theta[kMaxLawParameters];
  Physics<float> physics;
  LawName law;
};

// The first `parameters` values of theta are read; the others are 0.
__device__ inline TaskConstants constants_from(const float* term_weights, const float* theta,
                                               int parameters, const float* physics, LawName law) {
  TaskConstants c;
  c.law = law;
#pragma unroll
  for (int i = 0; i < kTerms; ++i) c.term_weights[i] = term_weights[i];
#pragma unroll
  for (int i = 0; i < kMaxLawParameters; ++i) c.theta[i] = i < parameters ? theta[i] : 0;
  c.physics = physics_from<float>(physics);
  return c;
}

// Constant i of kConstants: term weights, theta (0 beyond the law's parameters), physics.
__device__ inline float constant_of(const DeviceLoss<float>& a, std::int64_t e, int i) {
  if (i < kTerms) return a.term_weights.member(e)[i];
  if (i >= kSums) return a.physics.member(e)[i - kSums];
  return i - kTerms < a.parameters ? a.theta.member(e)[i - kTerms] : 0;
}

// Mapped coordinate `axis` of a tile's point p; the last point fills the tile.
__device__ inline float coordinate(const DeviceLoss<float>& a, std::int64_t e, const float* points,
                                   std::int64_t count, std::int64_t at, int p, int axis) {
  const std::int64_t row = at + p < count ? at + p : count - 1;
  return (points[3 * row + axis] - a.net.input.shift_of(e, axis)) * a.net.input.scale_of(e, axis);
}

// The law of the problem, chosen at run time.
struct AnyLaw {};

// Interior points: the velocity misfit, and the equations of the form F with a law.
template <class F, class Law>
struct Interior {
  static __device__ float xi(const DeviceLoss<float>& a, std::int64_t e, std::int64_t at, int p,
                             int axis) {
    return coordinate(a, e, a.points.member(e), a.n, at, p, axis);
  }
  // Component k of (u, v, w_velocity, w_physics) of a point.
  static __device__ float observed(const DeviceLoss<float>& a, std::int64_t e, std::int64_t at,
                                   int p, int k) {
    const float *velocity = a.velocity.member(e), *weights = a.point_weights.member(e);
    return at + p < a.n ? (k < 2 ? velocity : weights - 2)[2 * (at + p) + k] : 0;
  }

  // One thread for each point of the member's tile that begins at point `at`.
  template <class E, class Memory>
  static __device__ void evaluate(const DeviceLoss<float>& a, std::int64_t member, std::int64_t at,
                                  const TaskConstants& c, Memory& m) {
    constexpr int K = F::fields, C = F::channels;
    static_assert(K == 3 || K == 5, "a row is one float4 and, with five fields, one more");
    for (int p = threadIdx.x; p < E::PT; p += E::threads) {
      float z[K][C], z_a[K][C], w[F::residuals], e[F::residuals];
      float theta_a[kMaxLawParameters] = {};
#pragma unroll
      for (int ch = 0; ch < C; ++ch) {
        const float* row = m.raw() + (ch * E::PT + p) * kRow;
        const float4 four = *reinterpret_cast<const float4*>(row);
        z[0][ch] = four.x, z[1][ch] = four.y, z[2][ch] = four.z;
        if constexpr (K == 5) z[3][ch] = four.w, z[4][ch] = row[4];
      }
      const float* seen = m.observed + 4 * p;
#pragma unroll
      for (int r = 0; r < F::residuals; ++r)
        w[r] = c.term_weights[F::term_of(r)] / static_cast<float>(a.n) * seen[3];
      const std::int64_t i = at + p < a.n ? at + p : a.n - 1;
      const BodyForce<float> force = body_force(c.physics, a.source.member(member), i);
      if constexpr (std::is_same_v<Law, AnyLaw>)
        visit_law(c.law, [&](auto law) {
          F::template gradient<decltype(law)>(z, c.theta, c.physics, force, w, e, z_a, theta_a);
        });
      else
        F::template gradient<Law>(z, c.theta, c.physics, force, w, e, z_a, theta_a);
#pragma unroll
      for (int k = 0; k < 2; ++k) z_a[k][0] += misfit_slope(a, c, seen, k, z[0][0], z[1][0]);
#pragma unroll
      for (int ch = 0; ch < C; ++ch) {
        float* row = m.adjoint() + (ch * E::PT + p) * kRow;
        float4 four{z_a[0][ch], z_a[1][ch], z_a[2][ch], 0};
        if constexpr (K == 5) four.w = z_a[3][ch], row[4] = z_a[4][ch];
        *reinterpret_cast<float4*>(row) = four;
      }
      float squares[kTerms] = {misfit_square(c, seen, z[0][0], z[1][0])};
#pragma unroll
      for (int r = 0; r < F::residuals; ++r) squares[F::term_of(r)] += seen[3] * e[r] * e[r];
#pragma unroll
      for (int k = 0; k < kSums; ++k)
        m.terms()[k * E::R + p] = k < kTerms ? squares[k] : theta_a[k - kTerms];
    }
  }

  static __device__ float misfit_slope(const DeviceLoss<float>& a, const TaskConstants& c,
                                       const float* seen, int field, float z0, float z1) {
    const float U = c.physics.scale_of(field);
    const float factor = c.term_weights[kVelocity] / static_cast<float>(a.n) * U;
    return factor * seen[2] * (U * (field ? z1 : z0) - seen[field]);
  }
  static __device__ float misfit_square(const TaskConstants& c, const float* seen, float z0,
                                        float z1) {
    const float u = c.physics.scale_of(0) * z0 - seen[0], v = c.physics.scale_of(1) * z1 - seen[1];
    return seen[2] * (u * u + v * v);
  }
};

// No equations: values alone.
struct Values : Interior<MixedForm, AnyLaw> {
  template <class E, class Memory>
  static __device__ void evaluate(const DeviceLoss<float>& a, std::int64_t member, std::int64_t at,
                                  const TaskConstants& c, Memory& m) {
    using Misfit = Interior<MixedForm, AnyLaw>;
    for (int p = threadIdx.x; p < E::PT; p += E::threads) {
      const float *seen = m.observed + 4 * p, *z = m.raw() + p * kRow;
      for (int k = 0; k < kRow; ++k)
        m.adjoint()[p * kRow + k] = k < 2 ? Misfit::misfit_slope(a, c, seen, k, z[0], z[1]) : 0;
      for (int k = 0; k < kSums; ++k) m.terms()[k * E::R + p] = 0;
      m.terms()[kVelocity * E::R + p] = Misfit::misfit_square(c, seen, z[0], z[1]);
    }
  }
};

// Surface points: the pressure there.
template <PressureMap map>
struct Surface {
  static __device__ float xi(const DeviceLoss<float>& a, std::int64_t e, std::int64_t at, int p,
                             int axis) {
    return coordinate(a, e, a.surface_points.member(e), a.m, at, p, axis);
  }
  static __device__ float observed(const DeviceLoss<float>& a, std::int64_t e, std::int64_t at,
                                   int p, int k) {
    if (at + p >= a.m) return 0;
    return k == 0 ? a.surface_pressure.member(e)[at + p] : 1;
  }

  template <class E, class Memory>
  static __device__ void evaluate(const DeviceLoss<float>& a, std::int64_t member, std::int64_t at,
                                  const TaskConstants& c, Memory& m) {
    for (int p = threadIdx.x; p < E::PT; p += E::threads) {
      const float z = m.raw()[p * kRow + 2], weight = m.observed[4 * p + 1];
      const float P = c.physics.pressure_scale;
      const float e = pressure_value<map>(z, P) - m.observed[4 * p];
      const float factor = c.term_weights[kSurface] / static_cast<float>(a.m) * weight;
      for (int k = 0; k < kRow; ++k)
        m.adjoint()[p * kRow + k] = k == 2 ? factor * e * pressure_slope<map>(z, P) : 0;
      for (int k = 0; k < kSums; ++k) m.terms()[k * E::R + p] = 0;
      m.terms()[kSurface * E::R + p] = weight * e * e;
    }
  }
};

// The surface task with the pressure map of the network: softplus for five outputs, else linear.
struct SurfaceOfForm : Surface<PressureMap::softplus> {
  template <class E, class Memory>
  static __device__ void evaluate(const DeviceLoss<float>& a, std::int64_t member, std::int64_t at,
                                  const TaskConstants& c, Memory& m) {
    if (a.net.outputs() == MixedForm::fields)
      Surface<PressureMap::softplus>::evaluate<E>(a, member, at, c, m);
    else
      Surface<PressureMap::linear>::evaluate<E>(a, member, at, c, m);
  }
};

}  // namespace granpinn::cuda::fused
