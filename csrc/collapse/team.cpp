#include "team.h"

#include <stdexcept>
#include <string>
#include <system_error>

namespace granpinn::collapse {
namespace {

constexpr int kSmallestLoop = 8192;  // cells; below, waking a thread costs more than it saves
constexpr int kBlocksPerThread = 2;
constexpr int kMostThreads = 256;  // far below the 16 bits for the number of blocks
constexpr int kSpins = 2000;       // looks at the ticket before a thread goes to sleep

void pause() {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#endif
}

}  // namespace

Team::Team(int threads) {
  if (threads < 1 || threads > kMostThreads) {
    throw std::invalid_argument("threads must be from 1 to " + std::to_string(kMostThreads) +
                                ", got " + std::to_string(threads));
  }
  workers_.reserve(threads - 1);
  try {
    for (int index = 1; index < threads; ++index) workers_.emplace_back([this] { serve(); });
  } catch (const std::system_error&) {
    const auto started = workers_.size() + 1;
    stop();  // a thread that is not joined would end the process
    throw std::runtime_error("the machine starts only " + std::to_string(started) + " of " +
                             std::to_string(threads) + " threads: ask for fewer");
  }
}

Team::~Team() { stop(); }

void Team::stop() {
  stop_ = true;
  ticket_.fetch_add(std::uint64_t{1} << 32);
  ticket_.notify_all();
  for (auto& worker : workers_) worker.join();
}

void Team::rows(int begin, int end, int columns, const Body& body) {
  if (workers_.empty() || (end - begin) * columns < kSmallestLoop) {
    body(begin, end);
    return;
  }
  const auto blocks = kBlocksPerThread * (static_cast<std::uint64_t>(workers_.size()) + 1);
  begin_ = begin;
  end_ = end;
  body_ = &body;
  finished_.store(0, std::memory_order_relaxed);
  const std::uint64_t loop = (ticket_.load(std::memory_order_relaxed) >> 32) + 1;
  ticket_.store(loop << 32 | blocks << 16, std::memory_order_release);
  ticket_.notify_all();
  while (take_block()) {
  }
  for (int spins = 0; finished_.load(std::memory_order_acquire) < static_cast<int>(blocks);) {
    if (++spins < kSpins) {
      pause();
    } else {
      std::this_thread::yield();
    }
  }
}

// Runs one block of the present loop; false if none is left. A loop ends after its last block is
// done, so its bounds and body do not change while a thread runs a block.
bool Team::take_block() {
  std::uint64_t ticket = ticket_.load(std::memory_order_acquire);
  while (true) {
    const int block = ticket & 0xffff, blocks = ticket >> 16 & 0xffff;
    if (block >= blocks) return false;
    if (!ticket_.compare_exchange_weak(ticket, ticket + 1, std::memory_order_acq_rel)) continue;
    const int count = end_ - begin_;
    const int first = begin_ + count * block / blocks;
    const int last = begin_ + count * (block + 1) / blocks;
    if (first < last) (*body_)(first, last);
    finished_.fetch_add(1, std::memory_order_release);
    return true;
  }
}

void Team::serve() {
  int spins = 0;
  while (!stop_) {
    if (take_block()) {
      spins = 0;
      continue;
    }
    if (++spins < kSpins) {
      pause();
      continue;
    }
    const std::uint64_t ticket = ticket_.load(std::memory_order_acquire);
    const bool idle = (ticket & 0xffff) >= (ticket >> 16 & 0xffff);
    if (idle && !stop_) ticket_.wait(ticket, std::memory_order_acquire);
    spins = 0;
  }
}

}  // namespace granpinn::collapse
