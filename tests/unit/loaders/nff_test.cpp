// SPDX-License-Identifier: Apache-2.0
// Tests the meaning of every NFF line, and that errors name their line.
#include "render/loaders/nff.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <sstream>

#include "render/loaders/formats.h"
#include "render/loaders/load_scene.h"
#include "tests/support/error_matchers.h"

namespace lenticule::render {
namespace {

using test::error_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;

SceneDescription parse(const std::string& text) { return parse_nff(text, "scene.nff"); }

std::string refusal(const std::string& text) {
  const Error error = error_of([&] { (void)parse(text); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  return error.what();
}

const std::string kView =
    "v\nfrom 1 2 3\nat 0 0 0\nup 0 0 1\nangle 30\nhither 0.5\nresolution 640 480\n";
const std::string kBall = "s 0 0 0 1\n";

TEST(Nff, ReadsTheView) {
  const SceneDescription scene = parse(kView + kBall);
  ASSERT_THAT(scene.cameras, SizeIs(1));
  const Camera& camera = scene.cameras[0];
  EXPECT_EQ(camera.from, (Vec3{1, 2, 3}));
  EXPECT_EQ(camera.at, (Vec3{0, 0, 0}));
  EXPECT_EQ(camera.up, (Vec3{0, 0, 1}));
  EXPECT_EQ(camera.vertical_fov_degrees, 30.0);
  EXPECT_EQ(camera.hither, 0.5);
}

TEST(Nff, AnUpVectorAlongTheViewIsReplacedAndReported) {
  const SceneDescription scene =
      parse("v from 0 0 5 at 0 0 0 up 0 0 1 angle 30 hither 1 resolution 1 1\n" + kBall);
  EXPECT_NEAR(scene.cameras[0].up.z, 0.0, 1e-12);
  EXPECT_NEAR(length(scene.cameras[0].up), 1.0, 1e-12);
  EXPECT_THAT(scene.notes, Contains(HasSubstr("line 1")));
}

TEST(Nff, KeepsColoursUnchanged) {
  const SceneDescription scene = parse("b 0.1 0.2 0.3\nf 0.4 0.5 0.6 0.7 0.2 33 0.1 1.5\n" + kBall);
  EXPECT_FALSE(scene.colour_managed);
  EXPECT_EQ(scene.background, (Vec3{0.1, 0.2, 0.3}));
  const Material& m = scene.materials[static_cast<size_t>(scene.spheres[0].material)];
  EXPECT_EQ(m.colour, (Vec3{0.4, 0.5, 0.6}));
  EXPECT_EQ(m.diffuse, 0.7);
  EXPECT_EQ(m.specular, 0.2);
  EXPECT_EQ(m.shine, 33.0);
  EXPECT_EQ(m.transmittance, 0.1);
  EXPECT_EQ(m.refraction_index, 1.5);
}

TEST(Nff, AnIndexOfRefractionOfZeroMeansOne) {
  EXPECT_EQ(parse("f 1 1 1 1 0 0 0 0\n" + kBall).materials[0].refraction_index, 1.0);
}

TEST(Nff, LightsShareTheUsualIntensityAndKeepTheirColour) {
  const SceneDescription scene = parse("l 1 2 3\nl 4 5 6 1 0.5 0\n" + kBall);
  ASSERT_THAT(scene.lights, SizeIs(2));
  const double each = std::sqrt(2.0) / 4.0;
  EXPECT_EQ(scene.lights[0].position, (Vec3{1, 2, 3}));
  EXPECT_EQ(scene.lights[0].colour, (Vec3{each, each, each}));
  EXPECT_EQ(scene.lights[1].colour, (Vec3{each, each / 2, 0}));
  EXPECT_FALSE(scene.lights[0].falls_off);
  ASSERT_TRUE(scene.ambient.has_value());
  EXPECT_LT(scene.ambient->x, each);
}

TEST(Nff, ANegativeRadiusShowsTheInside) {
  const SceneDescription scene = parse("s 1 2 3 -4\nc 0 0 0 -1 0 0 2 -0.5\n");
  EXPECT_EQ(scene.spheres[0].radius, 4.0);
  EXPECT_TRUE(scene.spheres[0].inward);
  EXPECT_EQ(scene.cones[0].base_radius, 1.0);
  EXPECT_EQ(scene.cones[0].apex_radius, 0.5);
  EXPECT_TRUE(scene.cones[0].inward);
}

TEST(Nff, AConeAndACylinderKeepTheirEnds) {
  const SceneDescription scene = parse("c\n1 2 3 0.5\n4 5 6 0\nc 0 0 0 1 0 0 1 1\n");
  ASSERT_THAT(scene.cones, SizeIs(2));
  EXPECT_EQ(scene.cones[0].base, (Vec3{1, 2, 3}));
  EXPECT_EQ(scene.cones[0].apex, (Vec3{4, 5, 6}));
  EXPECT_EQ(scene.cones[0].apex_radius, 0.0);
  EXPECT_FALSE(scene.cones[0].inward);
  EXPECT_EQ(scene.cones[1].base_radius, scene.cones[1].apex_radius);
}

TEST(Nff, AConcavePolygonIsNotFanned) {
  // An arrow head: a fan from the first corner would cover the notch.
  const SceneDescription scene = parse("p 4\n-1 0 0  0 0.5 0  1 0 0  0 3 0\n");
  const TriangleMesh& mesh = scene.meshes.at(0);
  double area = 0.0;
  for (const auto& [a, b, c] : mesh.triangles)
    area += length(cross(mesh.positions[b] - mesh.positions[a],
                         mesh.positions[c] - mesh.positions[a])) /
            2.0;
  EXPECT_NEAR(area, 2.5, 1e-12);
}

TEST(Nff, PatchesCarryTheirNormalsAsUnitVectors) {
  const SceneDescription scene = parse("pp 3\n0 0 0 0 0 2\n1 0 0 0 3 4\n0 1 0 0 0 0\n");
  const TriangleMesh& mesh = scene.meshes.at(0);
  EXPECT_EQ(mesh.normals[0], (Vec3{0, 0, 1}));
  EXPECT_EQ(mesh.normals[1], (Vec3{0, 0.6, 0.8}));
  EXPECT_EQ(mesh.normals[2], (Vec3{0, 0, 1})) << "a zero normal becomes the polygon's";
  EXPECT_THAT(scene.notes, Contains(HasSubstr("1 normals of length 0")));
}

TEST(Nff, RepeatedFillsShareOneMaterialAndOneMesh) {
  std::string text;
  for (int i = 0; i < 50; ++i)
    text +=
        "f 1 0 0 1 0 1 0 1\np 3\n0 0 0 1 0 0 0 1 0\nf 0 1 0 1 0 1 0 1\np 3\n0 0 1 1 0 1 0 1 1\n";
  const SceneDescription scene = parse(text);
  EXPECT_THAT(scene.materials, SizeIs(2));
  EXPECT_THAT(scene.meshes, SizeIs(2));
  EXPECT_THAT(scene.meshes[0].triangles, SizeIs(50));
}

TEST(Nff, AcceptsWhitespaceAndCommentsAnywhere) {
  const SceneDescription scene =
      parse("# first\r\ns\t1\r\n2 # a comment\n\n   3\f+4e0#end\n#last, without a line feed");
  EXPECT_EQ(scene.spheres[0].centre, (Vec3{1, 2, 3}));
  EXPECT_EQ(scene.spheres[0].radius, 4.0);
}

/// Returns every property of a scene as one text.
std::string summary(const SceneDescription& scene) {
  std::ostringstream out;
  const auto vector = [&](Vec3 v) { out << v.x << ' ' << v.y << ' ' << v.z << "; "; };
  for (const Camera& c : scene.cameras) {
    for (const Vec3 v : {c.from, c.at, c.up}) vector(v);
    out << c.vertical_fov_degrees << ' ' << c.hither << '\n';
  }
  vector(scene.background);
  for (const Light& light : scene.lights) {
    vector(light.position);
    vector(light.colour);
  }
  for (const Material& m : scene.materials) {
    vector(m.colour);
    out << m.diffuse << ' ' << m.specular << ' ' << m.shine << ' ' << m.transmittance << ' '
        << m.refraction_index << '\n';
  }
  for (const Sphere& s : scene.spheres) {
    vector(s.centre);
    out << s.radius << ' ' << s.material << '\n';
  }
  for (const Cone& c : scene.cones) {
    vector(c.base);
    vector(c.apex);
    out << c.base_radius << ' ' << c.apex_radius << ' ' << c.material << '\n';
  }
  for (const TriangleMesh& mesh : scene.meshes) {
    for (const Vec3 v : mesh.positions) vector(v);
    for (const Vec3 v : mesh.normals) vector(v);
    out << mesh.triangles.size() << ' ' << mesh.material << '\n';
  }
  return out.str();
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  for (size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size())
    text.replace(at, what.size(), by);
  return text;
}

// The databases' generators, their ports and editors differ in white space, number formats and the
// position of comments.
TEST(Nff, EveryFormattingOfAFileGivesTheSameScene) {
  const std::string plain =
      "v\nfrom 2 0.5 -0.25\nat 0 0 0\nup 0 0 1\nangle 45\nhither 0.001\nresolution 512 512\n"
      "b 0.078 0.361 0.753\n"
      "l 4 0.5 2\nl 1 -4 4 0.5 0.25 1\n"
      "f 1 0.75 0.33 0.8 0 0 0 0\n"
      "p 4\n12 12 -0.5\n-12 12 -0.5\n-12 -12 -0.5\n12 -12 -0.5\n"
      "f 1 0.9 0.7 0.5 0.5 45.25 0.5 1.5\n"
      "s 0 0 0 0.5\n"
      "c\n0 0 0 0.25\n0 0 1 0.125\n"
      "pp 3\n0 0 1 0 0 1\n1 0 1 0 0 1\n0 1 1 0 0 1\n";
  const std::string expected = summary(parse(plain));
  const std::map<std::string, std::string> hands = {
      {"carriage returns and line feeds", replaced(plain, "\n", "\r\n")},
      {"carriage returns alone", "# old\r" + replaced(plain, "\n", "\r")},
      {"tabs", replaced(plain, " ", "\t")},
      {"wide columns", replaced(plain, " ", "    ")},
      {"one long line", replaced(plain, "\n", " ")},
      {"empty lines", replaced(plain, "\n", "\n\n \t\n")},
      {"no zero before the point", replaced(replaced(plain, " 0.", " ."), "-0.", "-.")},
      {"a point after whole numbers", replaced(plain, "12 ", "12. ")},
      {"exponents", replaced(replaced(plain, "0.001", "1e-3"), "0.5", "5.0E-01")},
      {"plus signs", replaced(plain, " 0.", " +0.")},
      {"a comment before every line", "# a\n" + replaced(plain, "\n", "\n# s 1 2 3 4 #\n")},
      {"a comment behind every line", replaced(plain, "\n", " # p 3\n")},
      {"no end of the last line", plain.substr(0, plain.size() - 1)},
  };
  for (const auto& [name, text] : hands) EXPECT_EQ(summary(parse(text)), expected) << name;
}

TEST(Nff, CountsLinesForEveryLineEnding) {
  for (const char* end : {"\n", "\r\n", "\r"})
    EXPECT_THAT(refusal(replaced("s 0 0 0 1\n# two\n\nq\n", "\n", end)),
                StartsWith("scene.nff:4: unknown line 'q'"));
}

TEST(Nff, InvisiblePrimitivesAreDroppedAndReported) {
  const SceneDescription scene =
      parse(kBall + "s 0 0 0 0\nc 0 0 0 1 0 0 0 1\np 3\n0 0 0 1 1 1 2 2 2\n");
  EXPECT_THAT(scene.spheres, SizeIs(1));
  EXPECT_THAT(scene.cones, IsEmpty());
  EXPECT_THAT(scene.meshes, IsEmpty());
  EXPECT_THAT(scene.notes, Contains(HasSubstr("1 spheres of radius 0")));
  EXPECT_THAT(scene.notes, Contains(HasSubstr("1 cones without")));
  EXPECT_THAT(scene.notes, Contains(HasSubstr("1 polygons without")));
}

TEST(Nff, AFileWithEveryKindOfLineLoads) {
  const SceneDescription scene =
      load_scene(std::string(LENTICULE_SOURCE_DIR) + "/tests/data/every-line.nff");
  EXPECT_THAT(scene.notes, IsEmpty());
  EXPECT_THAT(scene.cameras, SizeIs(1));
  EXPECT_THAT(scene.lights, SizeIs(2));
  EXPECT_THAT(scene.spheres, SizeIs(2));
  EXPECT_THAT(scene.cones, SizeIs(3));
  EXPECT_THAT(scene.materials, SizeIs(5));
}

// ---- refusals

struct Refusal {
  const char* name;
  const char* text;
  const char* message;
};
void PrintTo(const Refusal& refusal, std::ostream* out) { *out << refusal.name; }

class NffRefuses : public ::testing::TestWithParam<Refusal> {};

TEST_P(NffRefuses, WithTheLineAndTheReason) {
  EXPECT_THAT(refusal(GetParam().text), StartsWith(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Nff, NffRefuses,
    ::testing::Values(
        Refusal{"UnknownLine", "# one\ns 0 0 0 1\nq 1 2\n", "scene.nff:3: unknown line 'q'"},
        Refusal{"Binary", "\x01\x02\x7f\n", "scene.nff:1: unknown line '\?\?\?'"},
        Refusal{"NaN", "s 0 0\n0 nan\n", "scene.nff:2: the sphere's radius must be a finite"},
        Refusal{"Infinity", "s inf 0 0 1\n", "scene.nff:1: the sphere's centre must be a finite"},
        Refusal{"Overflow", "s 1e999 0 0 1\n", "scene.nff:1: the sphere's centre must be a finite"},
        Refusal{"TooFar", "s 1e300 0 0 1\n", "scene.nff:1: the sphere's centre must lie in"},
        Refusal{"Word", "s 1 2 x 1\n",
                "scene.nff:1: the sphere's centre must be a finite number, "
                "not 'x'"},
        Refusal{"HalfANumber", "s 1 2 3a 1\n", "scene.nff:1: the sphere's centre must be"},
        Refusal{"Truncated", "s 1 2\n", "scene.nff:1: the file ends before the sphere's centre"},
        Refusal{"TruncatedPolygon", "p 4\n0 0 0\n1 0 0\n", "scene.nff:3: the file ends before"},
        Refusal{"TwoCorners", "p 2\n0 0 0\n1 1 1\n", "scene.nff:1: a polygon needs at least 3"},
        Refusal{"NegativeCorners", "p -3\n", "scene.nff:1: the number of corners must lie in"},
        Refusal{"HugeCorners", "pp 2000000000\n", "scene.nff:1: a polygon of 2000000000 corners"},
        Refusal{"PartOfACorner", "p 3.5\n", "scene.nff:1: the number of corners must be a whole"},
        Refusal{"MixedCone", "c 0 0 0 1 0 0 1 -1\n", "scene.nff:1: the cone's radii"},
        Refusal{"NegativeKd", "f 1 1 1 -1 0 1 0 1\n", "scene.nff:1: Kd must lie in"},
        Refusal{"TooTransparent", "f 1 1 1 1 0 1 2 1\n", "scene.nff:1: T must lie in"},
        Refusal{"PointView", "v from 1 1 1 at 1 1 1 up 0 0 1 angle 1 hither 1 resolution 1 1",
                "scene.nff:1: the view's from and at"},
        Refusal{"WideView", "v from 1 1 1 at 0 0 0 up 0 0 1\nangle 180 hither 1 resolution 1 1",
                "scene.nff:2: angle must lie in"},
        Refusal{"WrongView", "v\nfrom 1 1 1\nto 0 0 0", "scene.nff:3: expected the view's 'at'"},
        Refusal{"TwoViews", "v from 1 1 1 at 0 0 0 up 0 0 1 angle 45 hither 1 resolution 1 1\nv\n",
                "scene.nff:2: a second view"},
        Refusal{"Empty", "", "scene.nff: nothing to see in this scene: it has no surface"},
        Refusal{"OnlyLights", "l 0 0 0\nb 1 1 1\n",
                "scene.nff: nothing to see in this scene: it has no surface"},
        Refusal{"OnlyDegenerate", "p 3 0 0 0 1 0 0 2 0 0\ns 0 0 0 0\n",
                "scene.nff: nothing to see in this scene: 1 polygons without an area dropped; 1 "
                "spheres of radius 0 dropped"}),
    [](const auto& refusal_case) { return std::string(refusal_case.param.name); });

TEST(Nff, RefusesTooManyLights) {
  std::string text;
  for (size_t i = 0; i <= kMaxLights; ++i) text += "l 0 0 0\n";
  EXPECT_THAT(refusal(text), StartsWith("scene.nff:1025: more than 1024 lights"));
}

TEST(Nff, ALongWordIsNotRepeatedInFull) {
  EXPECT_LT(refusal(std::string(100000, 'x')).size(), 200U);
}

}  // namespace
}  // namespace lenticule::render
