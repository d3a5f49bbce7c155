// SPDX-License-Identifier: Apache-2.0
// Tests the import of glTF with small generated models: one case per feature.
#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "tests/unit/loaders/gltf_features.h"

namespace lenticule::render {
namespace {

class GltfFeature : public ::testing::TestWithParam<GltfFeatureCase> {};

TEST_P(GltfFeature, IsReadFromTextAndBinary) {
  test::GltfModel model;
  GetParam().change(model);
  GetParam().expect(parse_gltf(model.gltf(), "model.gltf", std::nullopt));
  GetParam().expect(parse_gltf(model.glb(), "model.glb", std::nullopt));
}

std::string name_of(const ::testing::TestParamInfo<GltfFeatureCase>& info) {
  return info.param.name;
}

INSTANTIATE_TEST_SUITE_P(Geometry, GltfFeature, ::testing::ValuesIn(gltf_geometry_features()),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Nodes, GltfFeature, ::testing::ValuesIn(gltf_node_features()), name_of);
INSTANTIATE_TEST_SUITE_P(Motion, GltfFeature, ::testing::ValuesIn(gltf_motion_features()), name_of);
INSTANTIATE_TEST_SUITE_P(Materials, GltfFeature, ::testing::ValuesIn(gltf_material_features()),
                         name_of);

}  // namespace
}  // namespace lenticule::render
