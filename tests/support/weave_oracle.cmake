# SPDX-License-Identifier: Apache-2.0
add_library(lenticule_weave_oracle STATIC ${CMAKE_CURRENT_LIST_DIR}/weave_oracle.cpp
  ${CMAKE_CURRENT_LIST_DIR}/weave_rigs.cpp)
target_include_directories(lenticule_weave_oracle PRIVATE ${PROJECT_SOURCE_DIR}/tests)
target_link_libraries(lenticule_weave_oracle PUBLIC lenticule_options lenticule::frames)
