# SPDX-License-Identifier: Apache-2.0
# A writer of small glTF models, with the compressors whose output the loader reads.
add_library(lenticule_gltf_model STATIC ${CMAKE_CURRENT_LIST_DIR}/gltf_model.cpp)
target_link_libraries(lenticule_gltf_model
  PUBLIC lenticule_options lenticule::optics nlohmann_json::nlohmann_json
  PRIVATE draco::draco meshoptimizer::meshoptimizer)
