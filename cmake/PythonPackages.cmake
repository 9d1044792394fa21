# Finds Python's headers, pybind11 and torch through the interpreter that will import the module.
# torch's own CMake package is not used: with a CUDA build of torch it insists on a CUDA toolkit.
set(TORCH_OLDEST 2.11)
set(install_hint
  "Install the build tools beside torch and build against them:\n"
  "  pip install 'torch>=${TORCH_OLDEST}' scikit-build-core pybind11 cmake ninja\n"
  "  pip install --no-build-isolation .")

set(PYBIND11_FINDPYTHON ON)
find_package(Python 3.11 COMPONENTS Interpreter Development.Module)
if(NOT Python_Development.Module_FOUND)
  message(FATAL_ERROR
    "granpinn needs Python >= 3.11 with its C headers; found interpreter '${Python_EXECUTABLE}' without "
    "headers. Install them (Debian, Ubuntu: apt-get install python3-dev).")
endif()

# Sets OUT to the output of a line of Python, or stops with MESSAGE and the error.
function(ask_python out code message)
  execute_process(COMMAND ${Python_EXECUTABLE} -c "${code}" OUTPUT_VARIABLE text ERROR_VARIABLE error
    RESULT_VARIABLE status OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(NOT status EQUAL 0)
    string(CONCAT hint ${install_hint})
    message(FATAL_ERROR "${message}\n${hint}\n${Python_EXECUTABLE} said:\n${error}")
  endif()
  set(${out} "${text}" PARENT_SCOPE)
endfunction()

ask_python(pybind11_DIR "import pybind11; print(pybind11.get_cmake_dir())"
  "granpinn needs pybind11 to build, and Python cannot import it.")
find_package(pybind11 2.12 CONFIG REQUIRED)

ask_python(torch_facts
  "import os, torch; print(torch.__version__, os.path.dirname(torch.__file__), int(torch.compiled_with_cxx11_abi()), torch.version.cuda or 'none', sep=';')"
  "granpinn needs torch >= ${TORCH_OLDEST} to build, and Python cannot import torch.")
list(GET torch_facts 0 TORCH_VERSION)
list(GET torch_facts 1 TORCH_ROOT)
list(GET torch_facts 2 TORCH_CXX11_ABI)
list(GET torch_facts 3 TORCH_CUDA)  # the version of CUDA, or none
if(TORCH_VERSION VERSION_LESS TORCH_OLDEST)
  string(CONCAT hint ${install_hint})
  message(FATAL_ERROR "granpinn needs torch >= ${TORCH_OLDEST}, found ${TORCH_VERSION} in ${TORCH_ROOT}.\n${hint}")
endif()

add_library(torch_from_python INTERFACE)
target_include_directories(torch_from_python SYSTEM INTERFACE
  ${TORCH_ROOT}/include ${TORCH_ROOT}/include/torch/csrc/api/include)
target_compile_definitions(torch_from_python INTERFACE _GLIBCXX_USE_CXX11_ABI=${TORCH_CXX11_ABI})
foreach(name torch_cpu c10)
  find_library(TORCH_LIBRARY_${name} ${name} PATHS ${TORCH_ROOT}/lib NO_DEFAULT_PATH REQUIRED)
  target_link_libraries(torch_from_python INTERFACE ${TORCH_LIBRARY_${name}})
endforeach()

# at::parallel_for is a template whose `omp parallel` lies in our object files: it must run on the
# OpenMP library that torch has loaded, or torch.set_num_threads would govern another thread pool.
# torch's wheels bring their own copy in torch/lib; other builds use the system's.
target_compile_options(torch_from_python INTERFACE -fopenmp)
file(GLOB TORCH_OPENMP ${TORCH_ROOT}/lib/libgomp*.so*)
if(NOT TORCH_OPENMP)
  set(TORCH_OPENMP -fopenmp)
endif()
target_link_libraries(torch_from_python INTERFACE ${TORCH_OPENMP})
