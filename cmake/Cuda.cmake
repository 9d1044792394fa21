# The kernels for NVIDIA GPUs and their operators.
# GRANPINN_CUDA = auto, on or off (environment, or -C cmake.define):
#   auto  built where every torch is a CUDA build and the CUDA compiler of the same major version is
#         found
#   on    likewise, but an error where something is missing
# GRANPINN_CUDA_ARCHITECTURES is CMake's list, "90a" for a quick build, "native", "90a-real;100".
# torch's own libraries are linked; the CUDA toolkit is asked for nothing but nvcc and its runtime.
foreach(name GRANPINN_CUDA GRANPINN_CUDA_ARCHITECTURES)
  if(NOT DEFINED ${name} AND DEFINED ENV{${name}})
    set(${name} "$ENV{${name}}")
  endif()
endforeach()
if("${GRANPINN_CUDA}" STREQUAL "")  # not `if(NOT GRANPINN_CUDA)`: off is false
  set(GRANPINN_CUDA auto)
endif()
if(NOT GRANPINN_CUDA MATCHES "^(auto|on|off)$")
  message(FATAL_ERROR "GRANPINN_CUDA must be auto, on or off, got '${GRANPINN_CUDA}'.")
endif()
# code for 8.x (that of 8.0 runs on 8.6 and 8.9 too) and for 9.0 with its own instructions (90a), and
# PTX for newer ones
if(NOT GRANPINN_CUDA_ARCHITECTURES)
  set(GRANPINN_CUDA_ARCHITECTURES 80-real 90a-real 90-virtual)
endif()
string(REPLACE " " ";" GRANPINN_CUDA_ARCHITECTURES "${GRANPINN_CUDA_ARCHITECTURES}")

set(CUDA_MISSING "")
if(GRANPINN_CUDA STREQUAL off)
  set(CUDA_MISSING "switched off by GRANPINN_CUDA")
elseif(none IN_LIST TORCH_CUDA)
  list(FIND TORCH_CUDA none first)
  list(GET TORCH_VERSIONS ${first} version)
  set(CUDA_MISSING "torch ${version} is a build without CUDA, install one with it")
else()
  if(NOT CMAKE_CUDA_COMPILER)  # asked anew in each build: it may have been installed since
    unset(CMAKE_CUDA_COMPILER CACHE)
    if(NOT DEFINED ENV{CUDACXX})
      find_program(GRANPINN_NVCC nvcc HINTS ENV CUDA_HOME ENV CUDA_PATH PATHS /usr/local/cuda
        PATH_SUFFIXES bin)
      if(GRANPINN_NVCC)
        set(CMAKE_CUDA_COMPILER ${GRANPINN_NVCC})
      endif()
    endif()
  endif()
  include(CheckLanguage)
  check_language(CUDA)
  if(NOT CMAKE_CUDA_COMPILER)
    list(GET TORCH_CUDA 0 cuda)
    set(CUDA_MISSING
      "no CUDA compiler found, install CUDA ${cuda} like torch's or name nvcc in CUDACXX")
  endif()
endif()

if(NOT CUDA_MISSING)
  # one C++ library and one CUDA runtime in the process: those of torch
  set(CMAKE_CUDA_HOST_COMPILER ${CMAKE_CXX_COMPILER})
  set(CMAKE_CUDA_RUNTIME_LIBRARY Shared)
  set(CMAKE_CUDA_ARCHITECTURES ${GRANPINN_CUDA_ARCHITECTURES})
  enable_language(CUDA)
  string(REGEX MATCH "^[0-9]+" nvcc_major "${CMAKE_CUDA_COMPILER_VERSION}")
  foreach(cuda IN LISTS TORCH_CUDA)
    string(REGEX MATCH "^[0-9]+" torch_major "${cuda}")
    if(NOT torch_major EQUAL nvcc_major)
      string(CONCAT CUDA_MISSING "torch is built for CUDA ${cuda} but ${CMAKE_CUDA_COMPILER} is "
        "of CUDA ${CMAKE_CUDA_COMPILER_VERSION}, install one of CUDA ${torch_major}")
    endif()
  endforeach()
endif()

if(CUDA_MISSING)
  if(GRANPINN_CUDA STREQUAL on)
    message(FATAL_ERROR "GRANPINN_CUDA=on: ${CUDA_MISSING}.")
  endif()
  set(CUDA_COMPILER "")
  set(CUDA_ARCHITECTURES "")
  set(CUDA_SUMMARY "no CUDA kernels (${CUDA_MISSING})")
else()
  set(CUDA_COMPILER "${CMAKE_CUDA_COMPILER_ID} ${CMAKE_CUDA_COMPILER_VERSION}")
  list(JOIN GRANPINN_CUDA_ARCHITECTURES " " CUDA_ARCHITECTURES)
  set(CUDA_SUMMARY "CUDA kernels for ${CUDA_ARCHITECTURES} by ${CUDA_COMPILER}")
endif()

# Adds granpinn_cuda and, for every torch, the operators on top of it, where they can be built.
function(granpinn_add_cuda)
  if(CUDA_MISSING)
    return()
  endif()
  file(GLOB kernels RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS
    csrc/cuda/*.cu csrc/cuda/*/*.cu)
  file(GLOB operators RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS
    csrc/cuda/*.cpp csrc/cuda/*/*.cpp)

  # no torch header goes into a .cu file
  add_library(granpinn_cuda SHARED ${kernels})
  target_include_directories(granpinn_cuda PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/csrc)
  # warning 128 would tell of loops that one instance of a template never enters
  target_compile_options(granpinn_cuda PRIVATE
    --expt-relaxed-constexpr -lineinfo -diag-suppress=128 -Xcompiler=-Wall,-Wextra)
  # C++17: older releases of CMake do not know that nvcc has C++20
  set_target_properties(granpinn_cuda PROPERTIES CUDA_STANDARD 17 CUDA_STANDARD_REQUIRED ON
    CUDA_VISIBILITY_PRESET default VISIBILITY_INLINES_HIDDEN ON)
  set(targets granpinn_cuda)

  foreach(torch root IN ZIP_LISTS TORCH_BUILDS TORCH_ROOTS)
    set(target granpinn_${torch}_cuda)
    add_library(${target} SHARED ${operators})
    target_include_directories(${target} SYSTEM PRIVATE ${CMAKE_CUDA_TOOLKIT_INCLUDE_DIRECTORIES})
    target_link_libraries(${target} PRIVATE granpinn_options granpinn_cuda ${torch})
    target_link_libraries(${target} PRIVATE
      ${root}/lib/${CMAKE_SHARED_LIBRARY_PREFIX}c10_cuda${CMAKE_SHARED_LIBRARY_SUFFIX})
    list(APPEND targets ${target})
  endforeach()
  set(GRANPINN_TARGETS ${GRANPINN_TARGETS} ${targets} PARENT_SCOPE)
endfunction()
