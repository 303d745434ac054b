# find_package(slopewise): the target slopewise::core, the planner without Python, compiled with the
# program that links it (slopewise/core.hpp). Its options are public: both read the same headers, and
# their numbers are those of Python as long as no product and its sum are fused.
if(TARGET slopewise::core)
  return()
endif()
file(GLOB slopewise_sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_LIST_DIR}/slopewise/*.cpp)
add_library(slopewise_core STATIC ${slopewise_sources})
add_library(slopewise::core ALIAS slopewise_core)
target_compile_features(slopewise_core PUBLIC cxx_std_20)
target_include_directories(slopewise_core SYSTEM PUBLIC ${CMAKE_CURRENT_LIST_DIR})
target_compile_options(slopewise_core
  PUBLIC -ffp-contract=off -fno-math-errno -fno-trapping-math
  PRIVATE -Wall -Wextra -Wconversion -Wshadow)
set_target_properties(slopewise_core PROPERTIES POSITION_INDEPENDENT_CODE ON)
