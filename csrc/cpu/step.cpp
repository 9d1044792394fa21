// The operators of an optimization step on the CPU: plain loops over members and elements.
#include "step_ops.h"

#include <algorithm>

#include <ATen/Parallel.h>

#include "ops.h"

namespace granpinn {

namespace {

void note(std::int64_t* fault, std::int64_t step, Fault what) {
  *fault = std::min(*fault, step * kFaults + what);
}

// Whether all of n values are finite: a sum of differences that are 0 or NaN.
template <class T>
bool all_finite(const T* a, std::int64_t n) {
  constexpr int lanes = 16;
  T sums[lanes] = {};
  std::int64_t i = 0;
  for (; i + lanes <= n; i += lanes)
    for (int k = 0; k < lanes; ++k) sums[k] += a[i + k] - a[i + k];
  for (; i < n; ++i) sums[0] += a[i] - a[i];
  T sum = 0;
  for (const T s : sums) sum += s;
  return sum == T(0);
}

struct CpuStep {
  template <class T>
  static void draw(const BatchArguments<T>& a) {
    const std::int64_t step = a.control.counter[0];
    at::parallel_for(0, a.control.members, 1, [&](std::int64_t first, std::int64_t last) {
      for (std::int64_t e = first; e < last; ++e) {
        for (std::int64_t i = 0; i < a.interior; ++i) draw_point(a, e, i, step);
        for (std::int64_t j = 0; j < a.surface; ++j) draw_surface_point(a, e, j, step);
        weigh_terms(a, e, step);
      }
    });
  }

  template <class T>
  static void check(const CheckArguments<T>& a) {
    const std::int64_t step = a.control.counter[0];
    a.control.counter[2] = step;
    for (std::int64_t e = 0; e < a.control.members; ++e) {
      std::int64_t* fault = a.members.fault + e;
      if (!finite(a.loss[e])) note(fault, step, kLoss);
      if (!all_finite(a.grad_params + e * a.P, a.P)) note(fault, step, kGradient);
      if (!all_finite(a.grad_theta + e * 3, 3)) note(fault, step, kLawGradient);
    }
  }

  template <class T>
  static void update(const UpdateArguments<T>& a) {
    const std::int64_t step = a.control.counter[0];
    for (std::int64_t e = 0; e < a.control.members; ++e) {
      if (a.members.frozen(e, step, kParams)) continue;
      const double factor = a.control.row(step)[0] * a.members.slower[e];
      const std::int64_t t = a.members.counts[2 * e] + 1;
      const AdamRates<T> rates = adam_rates<T>(a.adam, factor, t);
      const std::int64_t from = e * a.P;
      bool good = true;
      std::int64_t at = from;
      for (int r = 0; r <= a.regions; ++r) {
        const std::int64_t end = from + (r < a.regions ? a.region[r].begin : a.P);
        for (; at < end; ++at)
          good &= adam(rates, a.gradient[at], a.params + at, a.first + at, a.second + at);
        if (r < a.regions)
          for (; at < end + a.region[r].size; ++at)
            good &= accumulate(static_cast<T>(a.momentum), a.gradient[at], a.first + at,
                               a.direction + at);
      }
      if (!good) note(a.members.fault + e, step, kParams);
    }
  }

  template <class T>
  static void descend(DescendArguments<T> a, const at::Tensor& G, c10::string_view precision) {
    const at::Tensor factors = orthogonalize_cpu(G, precision);
    a.U = factors.const_data_ptr<T>();
    const std::int64_t step = a.control.counter[0];
    for (std::int64_t e = 0; e < a.control.members; ++e) {
      if (a.members.frozen(e, step, kParams)) continue;
      const auto rate =
          static_cast<T>(a.learning_rate * a.control.row(step)[0] * a.members.slower[e]);
      bool good = true;
      for (std::int64_t l = 0; l < a.count; ++l) {
        const T* U = a.U + (e * a.count + l) * a.size;
        T* W = a.params + e * a.P + a.offset + l * a.apart;
        for (std::int64_t i = 0; i < a.size; ++i) good &= granpinn::descend(rate, U[i], W + i);
      }
      if (!good) note(a.members.fault + e, step, kParams);
    }
  }

  template <class T>
  static void finish(const FinishArguments<T>& a) {
    const std::int64_t step = a.control.counter[2];
    for (std::int64_t e = 0; e < a.control.members; ++e) {
      if (a.members.frozen(e, step, kLawScalars)) continue;
      finish_law(a, e, step);
      const auto weight = static_cast<T>(a.control.row(step)[1]);
      if (weight > 0)
        for (std::int64_t i = e * a.P; i < (e + 1) * a.P; ++i)
          a.average_params[i] = interpolate(a.average_params[i], a.params[i], weight);
    }
    a.control.counter[0] = step + 1;
  }
};

}  // namespace

TORCH_LIBRARY_IMPL(granpinn, CPU, m) { register_step<CpuStep>(m); }

}  // namespace granpinn
