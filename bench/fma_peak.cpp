// The multiply-add peak of one core: the yardstick of the CPU benchmarks.
//
// 24 registers (12 without AVX-512) hold independent chains a <- a b + c, so that no multiply-add
// waits for another one. Each counts as two floating-point operations.

#include <chrono>
#include <cstdint>

namespace {

#ifdef __AVX512F__
constexpr int kBytes = 64;   // of a register
constexpr int kChains = 24;  // of 32 registers
#elif defined(__AVX__)
constexpr int kBytes = 32;
constexpr int kChains = 12;  // of 16 registers
#else
constexpr int kBytes = 16;
constexpr int kChains = 12;
#endif
constexpr int kLanes = kBytes / sizeof(float);

typedef float Vec __attribute__((vector_size(kBytes)));

// `rounds` multiply-adds of each chain. The sum of the chains keeps the compiler from dropping
// them.
float multiply_add(std::int64_t rounds, float b, float c) {
  Vec a[kChains];
  for (int i = 0; i < kChains; ++i) a[i] = Vec{} + static_cast<float>(i);
  for (std::int64_t k = 0; k < rounds; ++k) {
#pragma GCC unroll 24
    for (int i = 0; i < kChains; ++i) a[i] = a[i] * b + c;
  }
  Vec sum{};
  for (int i = 0; i < kChains; ++i) sum += a[i];
  float total = 0;
  for (int lane = 0; lane < kLanes; ++lane) total += sum[lane];
  return total;
}

volatile float factor = 0.5F, summand = 1.0F, sink;

}  // namespace

// The best rate, in GFLOP/s, of batches of multiply-adds that fill `seconds`.
extern "C" double fma_peak(double seconds) {
  using Clock = std::chrono::steady_clock;
  constexpr std::int64_t kRounds = 1 << 17;  // a batch that a busy neighbour may spare
  const auto begin = Clock::now();
  double best = 0;
  do {
    const auto start = Clock::now();
    sink = multiply_add(kRounds, factor, summand);
    const std::chrono::duration<double> took = Clock::now() - start;
    const double rate = 2.0 * kChains * kLanes * kRounds / took.count() / 1e9;
    if (rate > best) best = rate;
  } while (std::chrono::duration<double>(Clock::now() - begin).count() < seconds);
  return best;
}
