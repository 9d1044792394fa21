// Headers that include this one are compiled once per instruction set, in the namespace below
// (cmake/Simd.cmake). team.h and parameters.h are common to all instruction sets. Of csrc/math only
// always-inline functions may be used: the linker would share others between instruction sets.
#pragma once

#if !defined(GRANPINN_SIMD_NAMESPACE)
#define GRANPINN_SIMD_NAMESPACE generic
#endif

// Before a loop whose input and output rows do not overlap, so that it can be vectorised.
#if defined(__clang__)
#define GRANPINN_INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#else
#define GRANPINN_INDEPENDENT _Pragma("GCC ivdep")
#endif
