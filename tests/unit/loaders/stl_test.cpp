// SPDX-License-Identifier: Apache-2.0
// Tests STL as programs write it: colours of two kinds, texts with names and capitals, counts and
// files that do not fit each other.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"
#include "frames/srgb.h"
#include "render/loaders/formats.h"
#include "tests/support/error_matchers.h"

namespace lenticule::render {
namespace {

using test::error_of;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::FloatNear;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

SceneDescription parse(const std::string& file) {
  return parse_stl({reinterpret_cast<const uint8_t*>(file.data()), file.size()}, "a.stl");
}
std::string refusal(const std::string& file) {
  return error_of([&] { (void)parse(file); }).what();
}

template <class T>
std::string bytes_of(std::initializer_list<T> values) {
  std::string bytes;
  for (const T value : values)
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);  // files are little endian
  return bytes;
}

/// Returns a binary file with a facet for each colour.
std::string binary(const std::vector<uint16_t>& colours, std::string header = {},
                   std::optional<uint32_t> count = std::nullopt, float coordinate = 1.0F) {
  header.resize(80);
  header += bytes_of<uint32_t>({count.value_or(static_cast<uint32_t>(colours.size()))});
  for (const uint16_t colour : colours)
    header += bytes_of<float>({0, 0, 0, 0, 0, 0, coordinate, 0, 0, 0, 1, 0}) +
              bytes_of<uint16_t>({colour});
  return header;
}

std::string facet(const std::string& third_corner = "0 1 0") {
  return "  facet normal 0 0 1\n    outer loop\n      vertex 0 0 0\n      vertex 1e0 +0 0\n"
         "      vertex " +
         third_corner + "\n    endloop\n  endfacet\n";
}
std::string solid(const std::string& name, const std::string& facets) {
  return "solid " + name + "\n" + facets + "endsolid " + name + "\n";
}
std::string upper_case(std::string text) {
  std::ranges::transform(text, text.begin(),
                         [](char c) { return c >= 'a' && c <= 'z' ? char(c - 'a' + 'A') : c; });
  return text;
}

auto is_colour(double red, double green, double blue) {
  const auto near = [](double code) {
    return FloatNear(static_cast<float>(frames::linear_from_srgb(code)), 1e-5F);
  };
  return ElementsAre(near(red), near(green), near(blue), 1.0F);
}

// ---- text

TEST(StlText, ReadsFacetsAsTheyAre) {
  const SceneDescription scene = parse(solid("part", facet("0 0.1 -2.5E-3") + facet()));
  ASSERT_THAT(scene.meshes, SizeIs(1));
  EXPECT_THAT(scene.meshes[0].triangles, SizeIs(2));
  EXPECT_EQ(scene.meshes[0].positions.at(2), (Vec3{0, 0.1, -0.0025})) << "in double precision";
  EXPECT_THAT(scene.meshes[0].colours, IsEmpty());
  EXPECT_THAT(scene.notes, IsEmpty());
}

TEST(StlText, ReadsEverySpellingThatProgramsWrite) {
  const std::string plain = solid("", facet());
  std::string returns = plain;
  for (size_t at = 0; (at = returns.find('\n', at)) != std::string::npos; at += 2)
    returns.replace(at, 1, "\r\n");
  const std::string cases[] = {plain,
                               returns,
                               upper_case(plain),
                               "\n \n" + plain,
                               solid("facet of a solid # 1", facet()),
                               solid("\xC3\xA9t\xC3\xA9", facet()),
                               "solid\n" + facet() + "endsolid",
                               solid("empty", "") + plain + solid("empty", "")};
  for (const std::string& file : cases) {
    SCOPED_TRACE(file);
    const SceneDescription scene = parse(file);
    ASSERT_THAT(scene.meshes, SizeIs(1));
    EXPECT_THAT(scene.meshes[0].triangles, SizeIs(1));
    EXPECT_THAT(scene.notes, IsEmpty());
  }
}

TEST(StlText, ReadsAllSolids) {
  const SceneDescription scene = parse(solid("a", facet()) + solid("b", facet() + facet()));
  EXPECT_THAT(scene.meshes.at(0).triangles, SizeIs(3));
}

TEST(StlText, DoesNotUseTheNormalsOfTheFile) {
  std::string file = solid("a", facet());
  file.replace(file.find("0 0 1"), 5, "nan -nan(ind) 7");
  EXPECT_THAT(parse(file).notes, IsEmpty());
}

TEST(StlText, NotesWhatFollowsTheLastSolid) {
  const SceneDescription scene = parse(solid("a", facet()) + "\x1A");
  EXPECT_THAT(scene.meshes, SizeIs(1));
  EXPECT_THAT(scene.notes, ElementsAre("text after the last solid left out"));
}

TEST(StlText, ErrorsHaveTheLine) {
  const std::string begin = "\nsolid a\n";
  EXPECT_THAT(refusal(begin + facet("0 nan 0")), HasSubstr("a.stl:7: a coordinate must be"));
  EXPECT_THAT(refusal(begin + facet("0 1e99 0")), HasSubstr("a.stl:7: a coordinate must lie"));
  EXPECT_THAT(refusal(begin + facet("0 0,5 0")),
              HasSubstr("a.stl:7: a coordinate must have a decimal point"));
  EXPECT_THAT(refusal(begin + facet("0 1 0\nvertex 1 1 0")),
              HasSubstr("a.stl:8: expected 'endloop', not 'vertex'"));
  EXPECT_THAT(refusal(begin + "colour 1 0 0\n"), HasSubstr("a.stl:3: expected 'facet'"));
  const std::string whole = begin + facet();
  EXPECT_THAT(refusal(whole.substr(0, whole.size() - 12)), HasSubstr("ends before 'endfacet'"));
}

TEST(StlText, ASceneWithoutFacetsIsEmpty) {
  EXPECT_THAT(refusal(solid("a", "") + solid("b", "")), HasSubstr("nothing to see"));
}

// ---- binary

TEST(StlBinary, ReadsFacets) {
  const SceneDescription scene = parse(binary({0, 0}));
  ASSERT_THAT(scene.meshes, SizeIs(1));
  EXPECT_THAT(scene.meshes[0].triangles, SizeIs(2));
  EXPECT_EQ(scene.meshes[0].positions.at(4), (Vec3{1, 0, 0}));
  EXPECT_THAT(scene.meshes[0].colours, IsEmpty());
  EXPECT_THAT(scene.notes, IsEmpty());
}

TEST(StlBinary, MayBeginAsATextDoes) {
  EXPECT_THAT(parse(binary({0}, "solid part")).meshes, SizeIs(1));
  EXPECT_THAT(parse(binary({0}, "solid" + std::string(75, ' '))).meshes, SizeIs(1));
}

TEST(StlBinary, TheHighestBitMarksAColourWithBlueLowest) {
  const auto colours = parse(binary({0x8000 | 31 << 10 | 15, 0})).meshes.at(0).colours;
  ASSERT_THAT(colours, SizeIs(6));
  EXPECT_THAT(colours[0], is_colour(1, 0, 15 / 31.0));
  EXPECT_THAT(colours[3], ElementsAre(0.6F, 0.6F, 0.6F, 1.0F)) << "as without colours";
}

TEST(StlBinary, MagicsHasADefaultColourAndOthersWithRedLowest) {
  const std::string header = "made by a program COLOR=\xC8\x64\x32\xFF,MATERIAL=";
  const auto colours = parse(binary({0x8000, 31 | 15 << 10}, header)).meshes.at(0).colours;
  ASSERT_THAT(colours, SizeIs(6));
  EXPECT_THAT(colours[0], is_colour(200 / 255.0, 100 / 255.0, 50 / 255.0));
  EXPECT_THAT(colours[3], is_colour(1, 0, 15 / 31.0));
}

TEST(StlBinary, ColoursThatTheHeaderCutsOffAreNotRead) {
  const std::string header = std::string(73, ' ') + "COLOR=\xC8";
  EXPECT_THAT(parse(binary({0}, header)).meshes.at(0).colours, IsEmpty());
}

TEST(StlBinary, NotesBytesAfterTheLastFacet) {
  const SceneDescription scene = parse(binary({0, 0}) + "three");
  EXPECT_THAT(scene.meshes.at(0).triangles, SizeIs(2));
  EXPECT_THAT(scene.notes, ElementsAre("5 bytes after the last facet left out"));
}

TEST(StlBinary, ACountOfZeroMeansAllFacets) {
  EXPECT_THAT(parse(binary({0, 0}, "", 0)).meshes.at(0).triangles, SizeIs(2));
}

TEST(StlBinary, ErrorsHaveTheByte) {
  EXPECT_THAT(refusal(binary({0, 0}, "", 3)),
              HasSubstr("a.stl: byte 80: 3 facets, but the file has room for 2"));
  EXPECT_THAT(refusal(binary({0}, "", 0xFFFFFFFF)), HasSubstr("4294967295 facets"));
  EXPECT_THAT(refusal("too short"), HasSubstr("a.stl: byte 9: the file ends in its header"));
  EXPECT_THAT(refusal(""), HasSubstr("byte 0"));
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(refusal(binary({0}, "", 1, kNan)),
              HasSubstr("a.stl: byte 108: a corner of facet 0 is not finite"));
  EXPECT_THAT(refusal(binary({0}, "", 1, 1e30F)), HasSubstr("is too far away"));
}

TEST(StlBinary, CoordinatesFarFromTheOriginAreNoted) {
  std::string file = binary({0});
  const std::string far = bytes_of<float>({1e7F, 0, 0, 1e7F + 8, 0, 0, 1e7F, 8, 0});
  file.replace(96, far.size(), far);
  EXPECT_THAT(parse(file).notes, Contains(HasSubstr("single precision")));
}

}  // namespace
}  // namespace lenticule::render
