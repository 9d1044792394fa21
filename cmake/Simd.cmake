# One object library per instruction set; the fastest that the processor has is chosen at run time.
# Inside, GRANPINN_SIMD_NAMESPACE names the namespace that keeps the variants apart.
set(SIMD_NAMES generic)
set(SIMD_FLAGS_generic)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|amd64)$")
  set(SIMD_NAMES generic avx2 avx512)
  set(SIMD_FLAGS_avx2 -mavx2 -mfma)
  set(SIMD_FLAGS_avx512 -mavx512f -mavx512dq -mavx512vl -mavx512bw -mfma -mprefer-vector-width=512)
endif()

# The order matters. An inline function or template from a common header may be emitted in every
# variant under one name; the linker keeps the first copy, which must be one that any processor can
# run. So the generic objects come before avx2, and avx2 before avx512.
function(granpinn_add_simd_objects module)
  foreach(name IN LISTS SIMD_NAMES)
    set(target ${module}_${name})
    add_library(${target} OBJECT ${ARGN})
    target_link_libraries(${target} PRIVATE granpinn_options)
    target_compile_definitions(${target} PRIVATE GRANPINN_SIMD_NAMESPACE=${name})
    target_compile_options(${target} PRIVATE ${SIMD_FLAGS_${name}} -ffp-contract=fast)
    target_sources(${module} PRIVATE $<TARGET_OBJECTS:${target}>)
  endforeach()
endfunction()
