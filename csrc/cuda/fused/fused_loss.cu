// Cuts a problem up, and launches pack, tiles, weights and collect.
#include "fused_loss.h"

#include <algorithm>

#include "collect.cuh"
#include "pack.cuh"
#include "variants.h"
#include "weights_kernel.cuh"

namespace granpinn::cuda::fused {

namespace {

constexpr int kDeepest = 8;                              // hidden layers
constexpr std::int64_t kPanels = std::int64_t(1) << 28;  // bytes of activations and adjoints

constexpr std::int64_t ceil_div(std::int64_t a, std::int64_t b) { return (a + b - 1) / b; }

Scratch carve(const DeviceLoss<float>& a, const Plan& plan, char* memory, std::size_t* size) {
  const std::int64_t E = a.net.members, hidden = plan.hidden - 1;
  std::size_t at = 0;
  const auto take = [&](std::int64_t bytes) {
    char* here = memory + at;
    at += static_cast<std::size_t>(ceil_div(bytes, 256) * 256);
    return here;
  };
  const auto floats = [&](std::int64_t count) { return reinterpret_cast<float*>(take(4 * count)); };
  Scratch s{};
  s.packed = floats(E * plan.packed());
  s.narrow = floats(E * plan.narrow());
  s.stash = floats(plan.shared_stash ? 0 : E * plan.slots * plan.stash());
  s.activations = floats(E * hidden * plan.panel());
  s.adjoints = floats(E * hidden * plan.panel());
  s.gradients = floats(E * hidden * plan.splits * plan.H * plan.H);
  s.narrow_gradients = floats(E * plan.slots * plan.narrow());
  s.sums = reinterpret_cast<double*>(take(8 * E * plan.slots * kSums));
  *size = at;
  return s;
}

template <int H>
cudaError_t pack(const DeviceLoss<float>& a, const Plan& plan, const Scratch& s,
                 cudaStream_t stream) {
  const dim3 grid(ceil_div(std::max<std::int64_t>(plan.packed(), plan.narrow()), 1024),
                  a.net.members);
  if (plan.tensor_cores)
    pack_kernel<H, true><<<grid, 256, 0, stream>>>(a, plan, s);
  else
    pack_kernel<H, false><<<grid, 256, 0, stream>>>(a, plan, s);
  return cudaGetLastError();
}

// Calls `visit` with the policy of the weights kernel.
template <int H, class Visit>
auto visit_weights(const Plan& plan, Visit visit) {
  if constexpr (H == 256)
    if (plan.large)
      return plan.tensor_cores ? visit(MmaWeights<256, 128, 16, 6>{})
                               : visit(SimtWeights<256, 256, 128, 16, 16, 6>{});
  return plan.tensor_cores ? visit(MmaWeights<128, 128, 32, 4>{})
                           : visit(SimtWeights<256, 128, 128, 16, 16, 8>{});
}

template <int H>
cudaError_t weights(const DeviceLoss<float>& a, const Plan& plan, const Scratch& s, Chunk chunk,
                    cudaStream_t stream) {
  return visit_weights<H>(plan, [&](auto policy) {
    using P = decltype(policy);
    const auto kernel = weights_kernel<P, H>;
    constexpr int bytes = weights_memory<P>();
    const cudaError_t error =
        cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes);
    if (error != cudaSuccess) return error;
    const dim3 grid((H / P::M) * (H / P::N), plan.splits, a.net.members * (plan.hidden - 1));
    kernel<<<grid, P::threads, bytes, stream>>>(plan, s, chunk);
    return cudaGetLastError();
  });
}

// Splits of the rows of a chunk: those that finish first, counted in stages of a block, of which
// its start and end take as much time as kExtra, and the fewest of these, since they are added up.
template <class P>
int choose_splits(const Plan& plan, std::int64_t panels, int multiprocessors) {
  constexpr int kExtra = 128 / P::stage_rows;
  const std::int64_t tiles = panels * (plan.H / P::M) * (plan.H / P::N);
  const std::int64_t slots = std::int64_t(multiprocessors) * P::blocks;
  const std::int64_t stages = ceil_div(std::int64_t(plan.chunk) * plan.rows, P::stage_rows);
  const auto time = [&](std::int64_t splits) {
    return ceil_div(tiles * splits, slots) * (ceil_div(stages, splits) + kExtra);
  };
  std::int64_t best = 1;
  for (std::int64_t splits = 2; splits <= std::min(stages, slots); ++splits)
    if (time(splits) < time(best)) best = splits;
  return static_cast<int>(best);
}

cudaError_t tiles(const DeviceLoss<float>& a, const Plan& plan, const Scratch& s, Chunk chunk,
                  cudaStream_t stream) {
  switch (a.form) {
    case Form::data:
      return launch_data_tiles(a, plan, s, chunk, stream);
    case Form::mixed:
      return launch_mixed_tiles(a, plan, s, chunk, stream);
    default:
      return launch_strong_tiles(a, plan, s, chunk, stream);
  }
}

template <int H>
cudaError_t run(const DeviceLoss<float>& a, const Plan& plan, const Scratch& s,
                cudaStream_t stream) {
  if (plan.tiles > 0) {
    if (const auto error = pack<H>(a, plan, s, stream)) return error;
    for (int begin = 0; begin < plan.tiles; begin += plan.chunk) {
      const Chunk chunk{begin, std::min(plan.chunk, plan.tiles - begin)};
      if (const auto error = tiles(a, plan, s, chunk, stream)) return error;
      if (plan.hidden > 1)
        if (const auto error = weights<H>(a, plan, s, chunk, stream)) return error;
    }
  }
  const dim3 grid((plan.hidden - 1) * H * H / (32 * kShares) + ceil_div(plan.narrow(), 32) + 1,
                  a.net.members);
  collect_kernel<H><<<grid, dim3(32, kShares), 0, stream>>>(a, plan, s);
  return cudaGetLastError();
}

}  // namespace

bool supports(const DeviceLoss<float>& a) {
  const int L = a.net.layers - 1;
  if (L < 1 || L > kDeepest || a.net.members > 65535 / kDeepest) return false;
  return *std::max_element(a.net.widths + 1, a.net.widths + 1 + L) <= kWidest;
}

Plan make_plan(const DeviceLoss<float>& a, bool tensor_cores, int multiprocessors) {
  const std::int64_t E = a.net.members;
  Plan p{};
  p.hidden = a.net.layers - 1;
  p.outputs = static_cast<int>(a.net.outputs());
  const std::int64_t widest = *std::max_element(a.net.widths + 1, a.net.widths + 1 + p.hidden);
  p.H = widest <= 128 ? 128 : 256;
  p.tensor_cores = tensor_cores;

  // large tiles need fewer weights per point; small ones keep every multiprocessor busy
  const int blocks = multiprocessors * (256 / p.H);
  const TileShape small = tile_shape(a.form, tensor_cores, false);
  p.large = E * ceil_div(a.n, small.points) > 2 * blocks;
  const TileShape shape = p.large ? tile_shape(a.form, tensor_cores, true) : small;
  p.points = shape.points;
  p.surface_points = shape.surface_points;
  p.rows = shape.rows;
  p.interior_tiles = static_cast<int>(ceil_div(a.n, p.points));
  p.tiles = p.interior_tiles + static_cast<int>(ceil_div(a.m, p.surface_points));
  if (p.tiles == 0) return p;

  // panel, ring and the small arrays of a tile take less than the rest of a multiprocessor's
  const int panels = tensor_cores ? 2 : 1, ring = 4 * 4 * kStage * p.H / 32;
  const int rest = 227 * 1024 * p.H / 256 - ring - 4 * (p.rows * 32 + p.narrow());
  p.shared_stash = 4 * (panels * p.rows * (p.H + 8) + p.stash()) <= rest;

  // as many rounds as it takes, each with the same number of blocks
  const std::int64_t most = std::max<std::int64_t>(1, blocks / E);
  const std::int64_t rounds = ceil_div(p.tiles, most);
  p.slots = static_cast<int>(ceil_div(p.tiles, rounds));
  const std::int64_t tile_bytes = std::int64_t(8) * p.rows * p.H * std::max(p.hidden - 1, 1);
  const std::int64_t fit = std::max<std::int64_t>(1, kPanels / (E * tile_bytes * p.slots));
  p.chunk = static_cast<int>(std::min<std::int64_t>(p.tiles, fit * p.slots));

  const std::int64_t layers = E * std::max(p.hidden - 1, 1);
  const auto splits = [&](auto policy) {
    return choose_splits<decltype(policy)>(p, layers, multiprocessors);
  };
  p.splits = p.H == 128 ? visit_weights<128>(p, splits) : visit_weights<256>(p, splits);
  return p;
}

std::size_t scratch_size(const DeviceLoss<float>& a, const Plan& plan) {
  std::size_t size = 0;
  carve(a, plan, nullptr, &size);
  return size;
}

cudaError_t loss(const DeviceLoss<float>& a, const Plan& plan, void* memory, cudaStream_t stream) {
  std::size_t size = 0;
  const Scratch s = carve(a, plan, static_cast<char*>(memory), &size);
  return plan.H == 128 ? run<128>(a, plan, s, stream) : run<256>(a, plan, s, stream);
}

}  // namespace granpinn::cuda::fused
