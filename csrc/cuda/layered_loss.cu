// residual_loss, layer after layer.
#include "misfit.cuh"

namespace granpinn::cuda {

namespace {

// Adds the blocks' sums, in order, to the totals [members][kSums].
__global__ void add_sums(const double* sums, int blocks, double* total) {
  const double* from = sums + static_cast<std::int64_t>(blockIdx.x) * blocks * kSums + threadIdx.x;
  double sum = 0;
#pragma unroll 8
  for (int b = 0; b < blocks; ++b) sum += from[b * kSums];
  total[blockIdx.x * kSums + threadIdx.x] += sum;
}

// Stores the outputs of a member from its totals, in one thread.
template <class T>
__global__ void store_loss(const __grid_constant__ DeviceLoss<T> a, std::int64_t first_member,
                           const double* total) {
  const std::int64_t e = first_member + blockIdx.x;
  const double* sums = total + blockIdx.x * kSums;
  double loss = 0;
  for (int k = 0; k < kTerms; ++k) {
    const std::int64_t points = k == kSurface ? a.m : a.n;
    const double term = points ? sums[k] / (2.0 * static_cast<double>(points)) : 0.0;
    a.terms[e * kTerms + k] = static_cast<T>(term);
    loss += static_cast<double>(a.term_weights.member(e)[k]) * term;
  }
  a.loss[e] = static_cast<T>(loss);
  const int parameters = a.parameters;
  for (int i = 0; i < parameters; ++i)
    a.grad_theta[e * parameters + i] = static_cast<T>(sums[kTerms + i]);
}

template <class T>
Layout<T> layout_of(const DeviceLoss<T>& a) {
  return Layout<T>(a.net, channels_of(a.form), std::max(a.n, a.m));
}

// The sums lie behind the network's panels: totals, then the sums of the blocks of a chunk.
template <class T>
std::size_t sums_bytes(const Layout<T>& layout) {
  const std::size_t blocks = blocks_of(layout.points, kMisfitThreads);
  return static_cast<std::size_t>(layout.members) * (1 + blocks) * kSums * sizeof(double);
}

template <class T>
class LayeredLoss {
 public:
  LayeredLoss(const DeviceLoss<T>& a, void* scratch, cudaStream_t stream)
      : a_(a),
        run_(stream),
        layout_(layout_of(a)),
        network_(a_.net, layout_, scratch, run_),
        total_(reinterpret_cast<double*>(static_cast<char*>(scratch) + layout_.end)) {}

  cudaError_t evaluate() {
    for (std::int64_t e = 0; e < a_.net.members; e += layout_.members) {
      const std::int64_t group = std::min(layout_.members, a_.net.members - e);
      network_.clear_gradient(group);
      run_.zero(total_, static_cast<std::size_t>(group) * kSums * sizeof(double));
      layout_.for_chunks(e, group, channels_of(a_.form), a_.n,
                         [&](const Chunk& chunk) { interior(chunk); });
      layout_.for_chunks(e, group, 1, a_.m, [&](const Chunk& chunk) { surface(chunk); });
      network_.store_gradient(e, group, a_.grad_params);
      run_(store_loss<T>, dim3(static_cast<unsigned>(group)), dim3(1), a_, e, total_);
    }
    return run_.status();
  }

 private:
  using Misfit = void (*)(const DeviceLoss<T>, Chunk, const T*, T*, double*);

  void interior(const Chunk& chunk) {
    if (a_.form == Form::mixed)
      misfit(chunk, a_.points, interior_adjoint<MixedForm, T>);
    else if (a_.form == Form::strong)
      misfit(chunk, a_.points, interior_adjoint<Strong, T>);
    else
      misfit(chunk, a_.points, value_adjoint<Target::velocity, T>);
  }

  void surface(const Chunk& chunk) {
    if (a_.net.outputs() == MixedForm::fields)
      misfit(chunk, a_.surface_points, value_adjoint<Target::softplus_pressure, T>);
    else
      misfit(chunk, a_.surface_points, value_adjoint<Target::linear_pressure, T>);
  }

  void misfit(const Chunk& chunk, const Batched<T>& points, Misfit kernel) {
    const T* raw = network_.forward(chunk, points);
    const unsigned blocks = blocks_of(chunk.count, kMisfitThreads);
    const unsigned group = static_cast<unsigned>(chunk.members);
    double* sums = total_ + layout_.members * kSums;
    run_(kernel, dim3(blocks, 1, group), dim3(kMisfitThreads), a_, chunk, raw, network_.adjoint(),
         sums);
    run_(add_sums, dim3(group), dim3(kSums), sums, static_cast<int>(blocks), total_);
    network_.backward(chunk);
  }

  using Strong = StrongForm<PressureMap::linear>;

  const DeviceLoss<T>& a_;
  Launcher run_;
  const Layout<T> layout_;
  LayeredNetwork<T> network_;
  double* total_;
};

}  // namespace

template <class T>
std::size_t layered_loss_scratch(const DeviceLoss<T>& a) {
  const Layout<T> layout = layout_of(a);
  return layout.end + sums_bytes(layout);
}

template <class T>
cudaError_t layered_loss(const DeviceLoss<T>& a, void* scratch, cudaStream_t stream) {
  return LayeredLoss<T>(a, scratch, stream).evaluate();
}

template std::size_t layered_loss_scratch(const DeviceLoss<float>&);
template std::size_t layered_loss_scratch(const DeviceLoss<double>&);
template cudaError_t layered_loss(const DeviceLoss<float>&, void*, cudaStream_t);
template cudaError_t layered_loss(const DeviceLoss<double>&, void*, cudaStream_t);

}  // namespace granpinn::cuda
