// A few threads that share loops over grid rows.
//
// A loop is cut into blocks that any thread may take. So on a busy machine a suspended thread does
// not delay the others. Every sum is formed per row first, so results do not depend on the number
// of threads. The module does not use OpenMP, because torch loads an OpenMP runtime of its own.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <thread>
#include <vector>

namespace granpinn::collapse {

class Team {
 public:
  using Body = std::function<void(int, int)>;

  explicit Team(int threads);
  ~Team();
  Team(const Team&) = delete;
  Team& operator=(const Team&) = delete;

  // Calls body(first, last) for blocks of rows that cover begin <= row < end. Loops over few cells
  // (rows x columns) stay on the calling thread.
  void rows(int begin, int end, int columns, const Body& body);

 private:
  void serve();
  void stop();
  bool take_block();

  // Number of the loop << 32 | number of blocks << 16 | next block.
  std::atomic<std::uint64_t> ticket_{0};
  std::atomic<int> finished_{0};
  std::atomic<bool> stop_{false};
  int begin_ = 0, end_ = 0;
  const Body* body_ = nullptr;
  std::vector<std::thread> workers_;
};

}  // namespace granpinn::collapse
