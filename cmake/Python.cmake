# Finds Python's headers and pybind11 through the interpreter that will import the modules.
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
