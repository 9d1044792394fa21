// Philox4x32-10: a counter-based random generator (Salmon et al., SC 2011).
//
// The output is a pure function of (counter, key): minibatches need no sampler state, a resumed
// run draws the same numbers as an uninterrupted one, and every device draws the same bits.
#pragma once

#include <cstdint>

#include "scalar.h"

namespace granpinn {

struct Philox4 {
  std::uint32_t x[4];
};

GRANPINN_HD Philox4 philox4x32_10(Philox4 counter, std::uint32_t key0, std::uint32_t key1) {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = 0xD2511F53ull * counter.x[0];
    const std::uint64_t b = 0xCD9E8D57ull * counter.x[2];
    counter = {
        {static_cast<std::uint32_t>(b >> 32) ^ counter.x[1] ^ key0, static_cast<std::uint32_t>(b),
         static_cast<std::uint32_t>(a >> 32) ^ counter.x[3] ^ key1, static_cast<std::uint32_t>(a)}};
    key0 += 0x9E3779B9u;
    key1 += 0xBB67AE85u;
  }
  return counter;
}

// The `i`-th of the indices in [0, population) drawn at `step` of a run: with replacement, bias
// below population / 2^64.
GRANPINN_HD std::int64_t sample_index(std::uint64_t seed, std::uint64_t step, std::uint32_t stream,
                                      std::uint32_t i, std::uint64_t population) {
  // two indices per block: the four words make two 64-bit numbers
  const Philox4 block = philox4x32_10(
      {{i / 2, static_cast<std::uint32_t>(step), static_cast<std::uint32_t>(step >> 32), stream}},
      static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32));
  const int at = 2 * static_cast<int>(i % 2);
  const std::uint64_t word = (static_cast<std::uint64_t>(block.x[at + 1]) << 32) | block.x[at];
  // the high half of the 128-bit product word * population: a multiply instead of a division
  const std::uint64_t lo = (word & 0xFFFFFFFFull) * population;
  const std::uint64_t hi = (word >> 32) * population + (lo >> 32);
  return static_cast<std::int64_t>(hi >> 32);
}

}  // namespace granpinn
