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
  s.stash = floats(E * plan.slots * plan.stash());
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

template <class P, int H, int B>
cudaError_t weights(const DeviceLoss<float>& a, const Plan& plan, const Scratch& s, Chunk chunk,
                    cudaStream_t stream) {
  const auto kernel = weights_kernel<P, H, B>;
  constexpr int bytes = weights_memory<P, B>();
  const cudaError_t error =
      cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes);
  if (error != cudaSuccess) return error;
  const dim3 grid((H / B) * (H / B), plan.splits, a.net.members * (plan.hidden - 1));
  kernel<<<grid, kWeightsThreads, bytes, stream>>>(plan, s, chunk);
  return cudaGetLastError();
}

template <int H>
cudaError_t weights(const DeviceLoss<float>& a, const Plan& plan, const Scratch& s, Chunk chunk,
                    cudaStream_t stream) {
  if (plan.large)
    return plan.tensor_cores ? weights<MmaWeights<128>, H, 128>(a, plan, s, chunk, stream)
                             : weights<SimtWeights<128>, H, 128>(a, plan, s, chunk, stream);
  return plan.tensor_cores ? weights<MmaWeights<64>, H, 64>(a, plan, s, chunk, stream)
                           : weights<SimtWeights<64>, H, 64>(a, plan, s, chunk, stream);
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

bool make_plan(const DeviceLoss<float>& a, bool tensor_cores, const DeviceLimits& device,
               Plan& plan) {
  const int L = a.net.layers - 1;
  const std::int64_t E = a.net.members;
  if (L < 1 || L > kDeepest || E > 65535 / kDeepest) return false;
  const std::int64_t widest = *std::max_element(a.net.widths + 1, a.net.widths + 1 + L);
  if (widest > kWidest) return false;
  Plan p{};
  p.hidden = L;
  p.outputs = static_cast<int>(a.net.outputs());
  p.H = widest <= 128 ? 128 : 256;

  // the first that fits: blocks that a multiprocessor holds, by registers and by shared memory
  int resident = 0;
  const auto try_shape = [&](bool tensor, bool large) {
    p.tensor_cores = tensor, p.large = large;
    p.tile = tile_shape(a.form, tensor, large);
    if (p.tile_bytes() > device.shared_per_block) return resident = 0;
    return resident = std::min(512 / (p.H * p.tile.split),
                               device.shared_per_multiprocessor / (p.tile_bytes() + 1024));
  };
  if (!(tensor_cores && try_shape(true, false)) && !try_shape(false, false)) return false;
  // large tiles need fewer weights per point; small ones keep every multiprocessor busy
  const bool tensor = p.tensor_cores;
  if (E * ceil_div(a.n, p.tile.points) > 2 * device.multiprocessors * resident)
    if (!try_shape(tensor, true)) try_shape(tensor, false);
  p.interior_tiles = static_cast<int>(ceil_div(a.n, p.tile.points));
  p.tiles = p.interior_tiles + static_cast<int>(ceil_div(a.m, p.tile.surface_points));
  plan = p;
  if (p.tiles == 0) return true;

  // as many rounds as it takes, each with the same number of blocks
  const std::int64_t most = std::max<std::int64_t>(1, device.multiprocessors * resident / E);
  const std::int64_t rounds = ceil_div(p.tiles, most);
  p.slots = static_cast<int>(ceil_div(p.tiles, rounds));
  const std::int64_t tile_bytes = std::int64_t(8) * p.tile.rows * p.H * std::max(p.hidden - 1, 1);
  const std::int64_t fit = std::max<std::int64_t>(1, kPanels / (E * tile_bytes * p.slots));
  p.chunk = static_cast<int>(std::min<std::int64_t>(p.tiles, fit * p.slots));

  const int B = p.large ? 128 : 64;
  const std::int64_t per_split = E * std::max(p.hidden - 1, 1) * (p.H / B) * (p.H / B);
  const std::int64_t stages = ceil_div(std::int64_t(p.chunk) * p.tile.rows, kStageRows);
  const std::int64_t wanted = 2 * device.multiprocessors / per_split;  // two on each at a time
  p.splits =
      static_cast<int>(std::clamp<std::int64_t>(wanted, 1, std::max<std::int64_t>(1, stages / 8)));
  plan = p;
  return true;
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
