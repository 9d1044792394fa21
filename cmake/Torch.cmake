# The torches that the operators are built for: that of Python or, for a wheel, the folders of
# several unpacked torch packages in GRANPINN_TORCH (environment, or -C cmake.define).
# Sets TORCH_BUILDS, for example torch_2.11 and torch_2.12, each a target with torch's headers and
# libraries, and in the same order TORCH_VERSIONS, TORCH_ROOTS and TORCH_CUDA (a version, or none).
# torch's own CMake package is not used: with a CUDA build of torch it insists on a CUDA toolkit.
if(NOT DEFINED GRANPINN_TORCH AND DEFINED ENV{GRANPINN_TORCH})
  set(GRANPINN_TORCH "$ENV{GRANPINN_TORCH}")
endif()

set(TORCH_BUILDS)
set(TORCH_VERSIONS)
set(TORCH_ROOTS)
set(TORCH_CUDA)

# Adds one torch, from the text "version;folder;C++11 ABI;CUDA".
function(add_torch facts)
  list(GET facts 0 version)
  list(GET facts 1 root)
  list(GET facts 2 cxx11_abi)
  list(GET facts 3 cuda)
  if(version VERSION_LESS TORCH_OLDEST)
    string(CONCAT hint ${install_hint})
    message(FATAL_ERROR "granpinn needs torch >= ${TORCH_OLDEST}, found ${version} in ${root}.\n${hint}")
  endif()
  string(REGEX MATCH "^[0-9]+\\.[0-9]+" minor "${version}")
  set(target torch_${minor})
  add_library(${target} INTERFACE)
  target_include_directories(${target} SYSTEM INTERFACE
    ${root}/include ${root}/include/torch/csrc/api/include)
  target_compile_definitions(${target} INTERFACE _GLIBCXX_USE_CXX11_ABI=${cxx11_abi})
  foreach(name torch_cpu c10)
    target_link_libraries(${target} INTERFACE
      ${root}/lib/${CMAKE_SHARED_LIBRARY_PREFIX}${name}${CMAKE_SHARED_LIBRARY_SUFFIX})
  endforeach()

  # at::parallel_for is a template whose `omp parallel` lies in our object files: it must run on
  # the OpenMP library that torch has loaded, or torch.set_num_threads would govern another thread
  # pool. So none is linked here: the loader finds its functions among the libraries of torch_cpu,
  # whatever name the OpenMP library of that torch has.
  target_compile_options(${target} INTERFACE -fopenmp)

  set(TORCH_BUILDS ${TORCH_BUILDS} ${target} PARENT_SCOPE)
  set(TORCH_VERSIONS ${TORCH_VERSIONS} ${version} PARENT_SCOPE)
  set(TORCH_ROOTS ${TORCH_ROOTS} ${root} PARENT_SCOPE)
  set(TORCH_CUDA ${TORCH_CUDA} ${cuda} PARENT_SCOPE)
endfunction()

if(GRANPINN_TORCH)
  foreach(folder IN LISTS GRANPINN_TORCH)
    # every release since ${TORCH_OLDEST} has the C++11 ABI
    ask_python(facts
      "import runpy; v = runpy.run_path('${folder}/version.py'); print(v['__version__'], '${folder}', 1, v['cuda'] or 'none', sep=';')"
      "GRANPINN_TORCH must list folders of unpacked torch packages, and ${folder} is none.")
    add_torch("${facts}")
  endforeach()
else()
  ask_python(facts
    "import os, torch; print(torch.__version__, os.path.dirname(torch.__file__), int(torch.compiled_with_cxx11_abi()), torch.version.cuda or 'none', sep=';')"
    "granpinn needs torch >= ${TORCH_OLDEST} to build, and Python cannot import torch.")
  add_torch("${facts}")
endif()
