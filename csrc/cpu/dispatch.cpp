// Selects the kernel table for this processor.
#include <cstdlib>
#include <cstring>

#include "kernel_table.h"

namespace granpinn {

#define GRANPINN_DECLARE(isa)                \
  namespace isa {                            \
  const KernelTable<float>& table_float();   \
  const KernelTable<double>& table_double(); \
  }

GRANPINN_DECLARE(generic)
#if defined(__x86_64__)
GRANPINN_DECLARE(avx2)
GRANPINN_DECLARE(avx512)
#endif

namespace {

// 0 generic, 1 AVX2 with FMA, 2 AVX-512
int instruction_set() {
  static const int chosen = [] {
    int level = 0;
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) level = 1;
    if (level == 1 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
      level = 2;
#endif
    const char* wish = std::getenv("GRANPINN_CPU");
    if (wish && !std::strcmp(wish, "generic")) level = 0;
    if (wish && !std::strcmp(wish, "avx2") && level > 1) level = 1;
    return level;
  }();
  return chosen;
}

}  // namespace

template <>
const KernelTable<float>& kernels<float>() {
#if defined(__x86_64__)
  if (instruction_set() == 2) return avx512::table_float();
  if (instruction_set() == 1) return avx2::table_float();
#endif
  return generic::table_float();
}

template <>
const KernelTable<double>& kernels<double>() {
#if defined(__x86_64__)
  if (instruction_set() == 2) return avx512::table_double();
  if (instruction_set() == 1) return avx2::table_double();
#endif
  return generic::table_double();
}

}  // namespace granpinn
