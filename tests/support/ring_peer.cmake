# SPDX-License-Identifier: Apache-2.0
add_library(lenticule_ring_peer STATIC ${CMAKE_CURRENT_LIST_DIR}/ring_peer.cpp)
target_link_libraries(lenticule_ring_peer PUBLIC lenticule::frames Threads::Threads)
