// network_jet and its adjoint, layer after layer.
#include "layered.h"

namespace granpinn::cuda {

namespace {

constexpr int kThreads = 256;

// Copies a run of `length` numbers for each channel (blockIdx.y) and member (blockIdx.z).
template <class T>
__global__ void copy_runs(const T* from, std::int64_t from_channel, std::int64_t from_member, T* to,
                          std::int64_t to_channel, std::int64_t to_member, std::int64_t length) {
  const std::int64_t at = static_cast<std::int64_t>(blockIdx.x) * kThreads + threadIdx.x;
  if (at >= length) return;
  to[blockIdx.z * to_member + blockIdx.y * to_channel + at] =
      from[blockIdx.z * from_member + blockIdx.y * from_channel + at];
}

template <class T>
dim3 runs_grid(const DeviceJet<T>& a, const Chunk& chunk) {
  return dim3(blocks_of(chunk.count * a.net.outputs(), kThreads), static_cast<unsigned>(a.channels),
              static_cast<unsigned>(chunk.members));
}

}  // namespace

template <class T>
std::size_t layered_jet_scratch(const DeviceJet<T>& a) {
  return Layout<T>(a.net, a.channels, a.n).end;
}

template <class T>
cudaError_t layered_jet(const DeviceJet<T>& a, void* scratch, cudaStream_t stream) {
  Launcher run(stream);
  const Layout<T> layout(a.net, a.channels, a.n);
  LayeredNetwork<T> network(a.net, layout, scratch, run);
  const std::int64_t K = a.net.outputs(), all = a.channels * a.n * K;
  for (std::int64_t e = 0; e < a.net.members; e += layout.members) {
    const std::int64_t group = std::min(layout.members, a.net.members - e);
    layout.for_chunks(e, group, a.channels, a.n, [&](const Chunk& chunk) {
      const T* raw = network.forward(chunk, a.points);
      const std::int64_t length = chunk.count * K;
      run(copy_runs<T>, runs_grid(a, chunk), dim3(kThreads), raw, length, a.channels * length,
          a.out + e * all + chunk.begin * K, a.n * K, all, length);
    });
  }
  return run.status();
}

template <class T>
cudaError_t layered_jet_adjoint(const DeviceJet<T>& a, void* scratch, cudaStream_t stream) {
  Launcher run(stream);
  const Layout<T> layout(a.net, a.channels, a.n);
  LayeredNetwork<T> network(a.net, layout, scratch, run);
  const std::int64_t K = a.net.outputs();
  for (std::int64_t e = 0; e < a.net.members; e += layout.members) {
    const std::int64_t group = std::min(layout.members, a.net.members - e);
    network.clear_gradient(group);
    layout.for_chunks(e, group, a.channels, a.n, [&](const Chunk& chunk) {
      network.forward(chunk, a.points);
      const std::int64_t length = chunk.count * K;
      run(copy_runs<T>, runs_grid(a, chunk), dim3(kThreads), a.grad.member(e) + chunk.begin * K,
          a.n * K, a.grad.stride, network.adjoint(), length, a.channels * length, length);
      network.backward(chunk);
    });
    network.store_gradient(e, group, a.grad_params);
  }
  return run.status();
}

template std::size_t layered_jet_scratch(const DeviceJet<float>&);
template std::size_t layered_jet_scratch(const DeviceJet<double>&);
template cudaError_t layered_jet(const DeviceJet<float>&, void*, cudaStream_t);
template cudaError_t layered_jet(const DeviceJet<double>&, void*, cudaStream_t);
template cudaError_t layered_jet_adjoint(const DeviceJet<float>&, void*, cudaStream_t);
template cudaError_t layered_jet_adjoint(const DeviceJet<double>&, void*, cudaStream_t);

}  // namespace granpinn::cuda
