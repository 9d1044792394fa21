// Makes the launch plan, and launches the kernels pack, tile, weights and collect (layout.h).
#include "fused_loss.h"

#include <algorithm>

#include "collect.cuh"
#include "pack.cuh"
#include "variants.h"
#include "weights_plan.cuh"

namespace granpinn::cuda::fused {

namespace {

constexpr std::int64_t kPanels = std::int64_t(1) << 30;  // bytes of activations and adjoints

// Addresses of the scratch arrays in `memory`; *size: their bytes.
Scratch carve(const DeviceLoss<float>& a, const LaunchPlan& plan, char* memory, std::size_t* size) {
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
  s.stash = floats(E * plan.slots * plan.stash());
  s.activations = take(E * hidden * plan.panel_bytes());
  s.adjoints = take(E * hidden * plan.panel_bytes());
  const std::int64_t scales = plan.tensor_cores ? E * hidden * plan.scales() : 0;
  s.activation_scales = reinterpret_cast<int*>(take(4 * scales));
  s.adjoint_scales = reinterpret_cast<int*>(take(4 * scales));
  s.gradients = floats(E * hidden * plan.splits * plan.H * plan.H);
  s.narrow_gradients = floats(E * plan.slots * plan.narrow());
  s.sums = reinterpret_cast<double*>(take(8 * E * plan.slots * kSums));
  *size = at;
  return s;
}

template <int H>
cudaError_t pack(const DeviceLoss<float>& a, const LaunchPlan& plan, const Scratch& s,
                 cudaStream_t stream) {
  const std::int64_t threads = pack_threads<H>(plan);
  const std::int64_t longest = std::max<std::int64_t>(threads, plan.narrow());
  const dim3 grid(ceil_div(longest, kPackThreads), 1 + H / kSlab * plan.tile.split, a.net.members);
  if (plan.tensor_cores)
    return launch_after(pack_kernel<H, true>, grid, kPackThreads, 0, stream, a, plan, s);
  return launch_after(pack_kernel<H, false>, grid, kPackThreads, 0, stream, a, plan, s);
}

template <int H>
cudaError_t weights(const DeviceLoss<float>& a, const LaunchPlan& plan, const Scratch& s,
                    Chunk chunk, cudaStream_t stream) {
  return visit_weights<H>(plan, [&](auto policy) {
    using P = decltype(policy);
    const auto kernel = weights_kernel<P, H>;
    const int bytes = P::memory(plan.weights_stages);
    const cudaError_t error =
        cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes);
    if (error != cudaSuccess) return error;
    const dim3 grid((H / P::M) * (H / P::N), plan.splits, a.net.members * (plan.hidden - 1));
    return launch_after(kernel, grid, P::threads, bytes, stream, plan, s, chunk);
  });
}

cudaError_t tiles(const DeviceLoss<float>& a, const LaunchPlan& plan, const Scratch& s, Chunk chunk,
                  cudaStream_t stream) {
  if (a.form == Form::data) return launch_data_tiles(a, plan, s, chunk, stream);
  const bool own = !a.own_laws && a.law == LawName::mu_of_i, mixed = a.form == Form::mixed;
  const auto launch = mixed ? (own ? launch_mixed_mu_of_i_tiles : launch_mixed_any_law_tiles)
                            : (own ? launch_strong_mu_of_i_tiles : launch_strong_any_law_tiles);
  return launch(a, plan, s, chunk, stream);
}

template <int H>
cudaError_t run(const DeviceLoss<float>& a, const LaunchPlan& plan, const Scratch& s,
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
  const std::int64_t hidden_blocks = std::int64_t(plan.hidden - 1) * H * H / kBlockWeights;
  const dim3 grid(hidden_blocks + ceil_div(plan.narrow(), 32) + 1, a.net.members);
  return launch_after(collect_kernel<H>, grid, dim3(32, kShares), 0, stream, a, plan, s);
}

}  // namespace

bool make_launch_plan(const DeviceLoss<float>& a, bool tensor_cores, const DeviceLimits& device,
                      LaunchPlan& plan) {
  const int L = a.net.layers - 1;
  const std::int64_t E = a.net.members;
  if (L < 1 || L > kDeepest || E > 65535 / kDeepest || a.net.count > INT32_MAX) return false;
  const std::int64_t widest = *std::max_element(a.net.widths + 1, a.net.widths + 1 + L);
  if (widest > kWidest) return false;
  LaunchPlan p{};
  p.hidden = L;
  p.outputs = static_cast<int>(a.net.outputs());
  for (int l = 0; l <= L; ++l) p.offsets[l] = static_cast<int>(a.net.offset(l));
  p.H = widest <= 128 ? 128 : 256;

  // blocks that fit on a multiprocessor, by registers and by shared memory
  int resident = 0;
  const auto take = [&](bool tensor, Size size) {
    p.tensor_cores = tensor, p.size = size;
    p.fine_weights = fine_weights(a.form, tensor);
    p.tile = tile_shape(a.form, tensor, size, p.H);
    p.interior_tiles = static_cast<int>(ceil_div(a.n, p.tile.points));
    p.tiles = p.interior_tiles + static_cast<int>(ceil_div(a.m, p.tile.surface_points));
    resident =
        p.tile_bytes() > device.shared_per_block
            ? 0
            : std::min(p.tile.blocks, device.shared_per_multiprocessor / (p.tile_bytes() + 1024));
    return resident > 0;
  };
  // Takes the largest tiles that fit, if there are enough of them for all multiprocessors. Medium
  // tiles are taken only if one round of blocks computes them all. Small tiles of wide layers need
  // more shared memory than medium ones, and more than some GPUs have.
  const auto enough = [&] { return 4 * E * p.tiles >= 3 * device.multiprocessors * resident; };
  const auto take_largest = [&](bool tensor) {
    if (take(tensor, Size::large) && enough()) return true;
    if (take(tensor, Size::medium) && enough()) {
      const bool one_round = E * p.tiles <= device.multiprocessors * resident;
      return one_round || take(tensor, Size::large) || take(tensor, Size::medium);
    }
    return take(tensor, Size::small) || take(tensor, Size::medium);
  };
  if (!(tensor_cores && take_largest(true)) && !take_largest(false)) return false;
  plan = p;
  if (p.tiles == 0) return true;

  // each round has the same number of blocks
  const std::int64_t most = std::max<std::int64_t>(1, device.multiprocessors * resident / E);
  const std::int64_t rounds = ceil_div(p.tiles, most);
  p.slots = static_cast<int>(ceil_div(p.tiles, rounds));
  const std::int64_t tile_bytes =
      std::int64_t(p.tensor_cores ? 4 : 8) * p.tile.panel_rows * p.H * std::max(p.hidden - 1, 1);
  const std::int64_t fit = std::max<std::int64_t>(1, kPanels / (E * tile_bytes * p.slots));
  p.chunk = static_cast<int>(std::min<std::int64_t>(p.tiles, fit * p.slots));

  if (!plan_weights(p, E * std::max(p.hidden - 1, 1), device)) return false;
  plan = p;
  return true;
}

std::size_t scratch_size(const DeviceLoss<float>& a, const LaunchPlan& plan) {
  std::size_t size = 0;
  carve(a, plan, nullptr, &size);
  return size;
}

cudaError_t loss(const DeviceLoss<float>& a, const LaunchPlan& plan, void* memory,
                 cudaStream_t stream) {
  std::size_t size = 0;
  const Scratch s = carve(a, plan, static_cast<char*>(memory), &size);
  return plan.H == 128 ? run<128>(a, plan, s, stream) : run<256>(a, plan, s, stream);
}

}  // namespace granpinn::cuda::fused
