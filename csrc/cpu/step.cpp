// One optimization step on the CPU: plain loops over members and elements.
//
// This file registers the CPU backend: the templates of CpuBackend are instantiated here.

#include <algorithm>

#include <ATen/Parallel.h>

#include "../math/philox.h"
#include "../ops/registration.h"
#include "backend.h"

namespace granpinn {

namespace {

void note(std::int64_t* fault, std::int64_t step, Fault what) {
  *fault = std::min(*fault, fault_code(step, what));
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

}  // namespace

template <class T>
void CpuBackend::draw(const BatchArguments<T>& a) {
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
void CpuBackend::update(const UpdateArguments<T>& a) {
  const std::int64_t step = a.control.counter[0];
  a.control.counter[0] = next(step);
  for (std::int64_t e = 0; e < a.control.members; ++e) {
    std::int64_t* fault = a.members.fault + e;
    if (a.members.frozen(e, step, kLoss)) continue;
    a.members.counts[2 * e] = next(a.members.counts[2 * e]);
    const auto [loss, law] = sound(a, e);
    if (!loss) note(fault, step, kLoss);
    if (!law) note(fault, step, kLawGradient);
    if (!all_finite(a.gradient + e * a.P, a.P)) note(fault, step, kGradient);
    if (a.members.frozen(e, step, kParams)) continue;
    const double factor = a.control.row(step)[0] * a.members.lr_scale[e];
    const AdamRates<T> rates = adam_rates<T>(a.adam, factor, a.members.counts[2 * e]);
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
    if (!good) note(fault, step, kParams);
    if (!move_law(a, e, step)) note(fault, step, kLawScalars);
  }
}

template <class T>
void CpuBackend::descend(DescendArguments<T> a, const at::Tensor& G, c10::string_view precision) {
  const at::Tensor factors = orthogonalize(G, precision);
  a.U = factors.const_data_ptr<T>();
  const std::int64_t step = a.control.updated();
  for (std::int64_t e = 0; e < a.control.members; ++e) {
    if (a.members.frozen(e, step, kParams)) continue;
    const auto rate =
        static_cast<T>(a.learning_rate * a.control.row(step)[0] * a.members.lr_scale[e]);
    bool good = true;
    for (std::int64_t l = 0; l < a.count; ++l) {
      const T* U = a.U + (e * a.count + l) * a.size;
      T* W = a.params + e * a.P + a.offset + l * a.apart;
      for (std::int64_t i = 0; i < a.size; ++i) good &= granpinn::descend(rate, U[i], W + i);
    }
    if (!good) note(a.members.fault + e, step, kParams);
  }
}
void CpuBackend::sample(const std::int64_t* step, std::uint64_t seed, std::uint32_t stream,
                        std::int64_t count, std::uint64_t population, std::int64_t* out) {
  for (std::int64_t i = 0; i < count; ++i)
    out[i] = sample_index(seed, static_cast<std::uint64_t>(*step), stream,
                          static_cast<std::uint32_t>(i), population);
}

TORCH_LIBRARY_IMPL(granpinn, CPU, m) { register_operators<CpuBackend>(m); }

}  // namespace granpinn
