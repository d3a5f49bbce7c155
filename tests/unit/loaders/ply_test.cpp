// SPDX-License-Identifier: Apache-2.0
// Tests the import of PLY: encodings, polygons, strips, colours, and damaged files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "render/loaders/formats.h"
#include "tests/support/error_matchers.h"

namespace lenticule::render {
namespace {

using test::error_of;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using Triangle = std::array<uint32_t, 3>;

SceneDescription parse(const std::string& text) {
  return parse_ply({reinterpret_cast<const uint8_t*>(text.data()), text.size()}, "model.ply",
                   "/nonexistent");
}

const std::string kVertices =
    "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
const std::string kSquare = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
const std::string kFaces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";

/// Appends numbers in the byte order of the format.
template <class T>
void append(std::string& to, std::initializer_list<T> values, bool big_endian) {
  for (const T value : values) {
    std::array<char, sizeof(T)> bytes{};
    std::memcpy(bytes.data(), &value, sizeof value);
    if (big_endian) std::reverse(bytes.begin(), bytes.end());
    to.append(bytes.data(), bytes.size());
  }
}

TEST(Ply, DividesPolygons) {
  const SceneDescription scene = parse("ply\nformat ascii 1.0\ncomment made by hand\n" + kVertices +
                                       kFaces + kSquare + "4 0 1 2 3\n");
  ASSERT_THAT(scene.meshes, SizeIs(1));
  EXPECT_THAT(scene.meshes[0].triangles, SizeIs(2));
  EXPECT_EQ(scene.meshes[0].positions[2], (Vec3{1, 1, 0}));
  EXPECT_THAT(scene.notes, IsEmpty());
}

TEST(Ply, ReadsHeadersOfOldBlenders) {
  const SceneDescription scene = parse("ply\nformat ascii 1.0\nCreated by Blender3D 247\n" +
                                       kVertices + kFaces + kSquare + "4 0 1 2 3\n");
  EXPECT_THAT(scene.meshes.at(0).triangles, SizeIs(2));
}

TEST(Ply, ReadsBinaryFilesOfBothByteOrders) {
  for (const bool big : {false, true}) {
    std::string file = std::string("ply\nformat ") +
                       (big ? "binary_big_endian" : "binary_little_endian") +
                       " 1.0\nelement vertex 3\nproperty double x\nproperty short y\n"
                       "property float z\nproperty uchar quality\n" +
                       kFaces;
    for (const int i : {0, 1, 2}) {
      append<double>(file, {i == 1 ? 10000000.125 : 10000000.0}, big);
      append<int16_t>(file, {static_cast<int16_t>(i == 2 ? -300 : 0)}, big);
      append<float>(file, {0.5F}, big);
      append<uint8_t>(file, {200}, big);
    }
    append<uint8_t>(file, {3}, big);
    append<int32_t>(file, {0, 1, 2}, big);
    const SceneDescription scene = parse(file);
    EXPECT_EQ(scene.meshes.at(0).positions[1], (Vec3{10000000.125, 0, 0.5})) << big;
    EXPECT_EQ(scene.meshes[0].positions[2].y, -300.0) << big;
    EXPECT_THAT(scene.meshes[0].triangles, ElementsAre(Triangle{0, 1, 2})) << big;
  }
}

TEST(Ply, ReadsTriangleStripsThatMinusOneDivides) {
  const SceneDescription scene =
      parse("ply\nformat ascii 1.0\n" + kVertices +
            "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" + kSquare +
            "8 0 1 3 2 -1 0 1 2\n");
  EXPECT_THAT(scene.meshes.at(0).triangles,
              ElementsAre(Triangle{0, 1, 3}, Triangle{3, 1, 2}, Triangle{0, 1, 2}));
  for (const auto& [a, b, c] : scene.meshes[0].triangles) {
    const auto& p = scene.meshes[0].positions;
    EXPECT_GT(cross(p[b] - p[a], p[c] - p[a]).z, 0.0) << "all faces have one orientation";
  }
}

TEST(Ply, ConvertsVertexColoursToLight) {
  const SceneDescription scene = parse(
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "property uchar alpha\n" +
      kFaces + "0 0 0 255 0 188 255\n1 0 0 255 0 0 51\n0 1 0 0 0 0 0\n3 0 1 2\n");
  const TriangleMesh& mesh = scene.meshes.at(0);
  ASSERT_THAT(mesh.colours, SizeIs(3));
  EXPECT_EQ(mesh.colours[0][0], 1.0F);
  EXPECT_NEAR(mesh.colours[0][2], 0.5029, 1e-4);
  EXPECT_NEAR(mesh.colours[1][3], 0.2, 1e-6);
  const auto& pbr = scene.materials.at(static_cast<size_t>(mesh.material)).pbr;
  ASSERT_TRUE(pbr) << "colours need a material that shows them";
  EXPECT_EQ(pbr->base_colour, (Vec3{1, 1, 1}));
  EXPECT_EQ(pbr->metallic, 0.0);
}

TEST(Ply, ReadsNormalsAndTextureCoordinates) {
  const SceneDescription scene = parse(
      "ply\r\nformat ascii 1.0\r\nelement vertex 3\r\nproperty float x\r\nproperty float y\r\n"
      "property float z\r\nproperty float nx\r\nproperty float ny\r\nproperty float nz\r\n"
      "property float s\r\nproperty float t\r\n"
      "element face 1\r\nproperty list uchar int vertex_index\r\nend_header\r\n"
      "0 0 0 0 0 2 0 0\r\n1 0 0 0 0 1 1 0\r\n0 1 0 0 0 1 0 1\r\n3 0 1 2\r\n");
  EXPECT_EQ(scene.meshes.at(0).normals[0], (Vec3{0, 0, 1}));
  EXPECT_THAT(scene.meshes[0].uvs[0], ElementsAre(0.0F, 1.0F)) << "v = 0 is at the top";
  EXPECT_THAT(scene.meshes[0].uvs[2], ElementsAre(0.0F, 0.0F));
}

TEST(Ply, ReadsTextureCoordinatesOfFaces) {
  const SceneDescription scene =
      parse("ply\nformat ascii 1.0\ncomment TextureFile no such.png\n" + kVertices +
            "element face 2\nproperty list uchar int vertex_indices\n"
            "property list uchar float texcoord\nend_header\n" +
            kSquare + "3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0.5 0.5 0.5 0.5 0.5 0.5\n");
  const TriangleMesh& mesh = scene.meshes.at(0);
  ASSERT_THAT(mesh.uvs, SizeIs(6)) << "every face has its own corners";
  EXPECT_THAT(mesh.uvs[2], ElementsAre(1.0F, 0.0F));
  EXPECT_THAT(mesh.uvs[3], ElementsAre(0.5F, 0.5F));
  EXPECT_EQ(mesh.positions[mesh.triangles[1][2]], (Vec3{0, 1, 0}));
  EXPECT_THAT(scene.notes, Contains(HasSubstr("no such.png")));
}

TEST(Ply, NotesCoordinatesThatSinglePrecisionHasMadeCoarse) {
  std::string file =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
      "property float y\nproperty float z\n" +
      kFaces;
  append<float>(file, {1e7F, 0, 0, 1e7F + 2, 0, 0, 1e7F, 2, 0}, false);
  append<uint8_t>(file, {3}, false);
  append<int32_t>(file, {0, 1, 2}, false);
  EXPECT_THAT(parse(file).notes, Contains(HasSubstr("single precision")));
}

TEST(Ply, RefusesDamagedFiles) {
  const std::string header = "ply\nformat ascii 1.0\n" + kVertices + kFaces;
  const std::vector<std::pair<std::string, const char*>> damaged{
      {"", "model.ply:1: the header does not end"},
      {"plz\n", "model.ply:1: expected 'ply'"},
      {"ply\nformat ascii 1.0\nelement vertex 3\n", "model.ply:4: the header does not end"},
      {"ply\nformat utf 1.0\n", "unknown format"},
      {"ply\nelement vertex 3\nend_header\n", "the header states no format"},
      {"ply\nformat ascii 1.0\nelement vertex -1\nend_header\n", "no number of elements"},
      {"ply\nformat ascii 1.0\nproperty float x\nend_header\n", "unexpected"},
      {"ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\nend_header\n", "unknown type"},
      {"ply\nformat ascii 1.0\nelement vertex 9999999999\nproperty float x\nend_header\n0\n",
       "9999999999 elements"},
      {"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n",
       "vertices without x, y and z"},
      {header + "0 0 0\n1 0 0\n1 1 0\n", "vertex' 3: the file ends here"},
      {header + "0 0 0\n1 0 0\n1 x 0\n0 1 0\n3 0 1 2\n", "is no number"},
      {header + "0 0 0\n1 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n", "vertex' 2: is not finite"},
      {header + "0 0 0\n1 0 0\n1 1e300 0\n0 1 0\n3 0 1 2\n", "vertex' 2: is too far away"},
      {header + kSquare + "3 0 1 4\n", "face' 0: names vertex 4 of 4"},
      {header + kSquare + "3 0 1 -1\n", "face' 0: names vertex -1 of 4"},
      {header + kSquare + "200 0 1 2\n", "face' 0: a list of 200 values"},
      {"ply\nformat ascii 1.0\n" + kVertices + "end_header\n" + kSquare, "4 points without faces"},
  };
  for (const auto& [text, message] : damaged) {
    const Error error = error_of([&, &text = text] { (void)parse(text); });
    EXPECT_EQ(error.kind(), ErrorKind::Input) << text;
    EXPECT_THAT(error.what(), HasSubstr(message)) << text;
  }
}

}  // namespace
}  // namespace lenticule::render
