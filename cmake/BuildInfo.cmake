# Writes build_info.h: what the module was built with, for granpinn._C.build_info() and doctor.
set(BUILD_INFO_DIR ${CMAKE_CURRENT_BINARY_DIR}/generated)
list(JOIN SIMD_NAMES " " BUILD_SIMD)
string(TOUPPER ${CMAKE_BUILD_TYPE} build_type)
get_target_property(options granpinn_options INTERFACE_COMPILE_OPTIONS)
list(JOIN options " " options)
string(STRIP "-std=c++${CMAKE_CXX_STANDARD} ${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${build_type}} ${options} -fopenmp" BUILD_FLAGS)
string(REGEX REPLACE " +" " " BUILD_FLAGS "${BUILD_FLAGS}")
configure_file(${CMAKE_CURRENT_LIST_DIR}/build_info.h.in ${BUILD_INFO_DIR}/build_info.h @ONLY)
