# SPDX-License-Identifier: Apache-2.0
add_executable(lenticule_fake_video ${CMAKE_CURRENT_LIST_DIR}/fake_video.cpp)
target_link_libraries(lenticule_fake_video PRIVATE lenticule::frames Threads::Threads)
