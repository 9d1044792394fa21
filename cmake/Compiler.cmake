# Finds the C++ compiler, refuses one that is too old, and sets the flags that every file shares.
include(CheckLanguage)
check_language(CXX)
if(NOT CMAKE_CXX_COMPILER)
  message(FATAL_ERROR
    "granpinn needs a C++20 compiler and found none. Install one (Debian, Ubuntu: apt-get install g++; "
    "conda: conda install -c conda-forge cxx-compiler) or name it in the environment variable CXX.")
endif()
enable_language(CXX)

set(OLDEST_GNU 11)
set(OLDEST_Clang 14)
set(OLDEST_AppleClang 14)
set(oldest ${OLDEST_${CMAKE_CXX_COMPILER_ID}})
if(oldest AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS ${oldest})
  message(FATAL_ERROR
    "granpinn needs ${CMAKE_CXX_COMPILER_ID} >= ${oldest} (C++20), found ${CMAKE_CXX_COMPILER_VERSION} at "
    "${CMAKE_CXX_COMPILER}. Name a newer compiler in the environment variable CXX.")
endif()

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_CXX_VISIBILITY_PRESET hidden)

# No -ffast-math: results must not depend on how the compiler reorders sums, and NaN must stay NaN.
# The two flags below only drop errno and floating-point exception flags, which nobody reads here;
# without them a loop with sqrt or a clamp is not vectorised.
add_library(granpinn_options INTERFACE)
target_compile_options(granpinn_options INTERFACE
  -Wall -Wextra -fno-math-errno -fno-trapping-math)
target_include_directories(granpinn_options INTERFACE ${CMAKE_CURRENT_SOURCE_DIR}/csrc)

# For bench/sanitize_host.py: the first report of a sanitizer ends the process.
option(GRANPINN_SANITIZE "Check memory, integers and casts of the host code while it runs" OFF)
if(GRANPINN_SANITIZE)
  set(SANITIZERS -fsanitize=address,undefined,float-cast-overflow)
  target_compile_options(granpinn_options INTERFACE
    ${SANITIZERS} -fno-sanitize=vptr -fno-sanitize-recover=all -fno-omit-frame-pointer -g1)
  target_link_options(granpinn_options INTERFACE ${SANITIZERS})
endif()
