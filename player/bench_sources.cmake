# SPDX-License-Identifier: Apache-2.0
# `bench`: one file per benchmark.
target_sources(lenticule_player PRIVATE
  ${CMAKE_CURRENT_LIST_DIR}/bench_exact.cpp
  ${CMAKE_CURRENT_LIST_DIR}/bench_memory.cpp
  ${CMAKE_CURRENT_LIST_DIR}/benchmarks.cpp)
