# SPDX-License-Identifier: Apache-2.0
# `play`: pacing, the presenter, its sources and statistics.
target_sources(lenticule_player PRIVATE
  ${CMAKE_CURRENT_LIST_DIR}/bench_play.cpp
  ${CMAKE_CURRENT_LIST_DIR}/cadence.cpp
  ${CMAKE_CURRENT_LIST_DIR}/filler.cpp
  ${CMAKE_CURRENT_LIST_DIR}/latency_histogram.cpp
  ${CMAKE_CURRENT_LIST_DIR}/pacing.cpp
  ${CMAKE_CURRENT_LIST_DIR}/play_statistics.cpp
  ${CMAKE_CURRENT_LIST_DIR}/playback.cpp
  ${CMAKE_CURRENT_LIST_DIR}/presenter.cpp
  ${CMAKE_CURRENT_LIST_DIR}/source_open.cpp
  ${CMAKE_CURRENT_LIST_DIR}/wake_fd.cpp)
