# SPDX-License-Identifier: Apache-2.0
# `render`: scenes frame by frame, and where frames go.
target_sources(lenticule_player PRIVATE
  ${CMAKE_CURRENT_LIST_DIR}/camera_path.cpp
  ${CMAKE_CURRENT_LIST_DIR}/frame_output.cpp
  ${CMAKE_CURRENT_LIST_DIR}/scene_sequence.cpp
  ${CMAKE_CURRENT_LIST_DIR}/triple.cpp)
