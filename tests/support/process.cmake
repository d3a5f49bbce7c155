# SPDX-License-Identifier: Apache-2.0
add_library(lenticule_test_process STATIC ${CMAKE_CURRENT_LIST_DIR}/process.cpp)
target_link_libraries(lenticule_test_process PUBLIC lenticule_options Threads::Threads)
