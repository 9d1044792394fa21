// Everything from here to the time step is compiled once per instruction set; the namespace below
// keeps the variants apart (cmake/Simd.cmake). team.h and parameters.h are common to all.
#pragma once

#if !defined(GRANPINN_SIMD_NAMESPACE)
#define GRANPINN_SIMD_NAMESPACE generic
#endif

// Tells the compiler that the rows which a loop reads and writes do not overlap.
#if defined(__clang__)
#define GRANPINN_INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#else
#define GRANPINN_INDEPENDENT _Pragma("GCC ivdep")
#endif
