// SPDX-License-Identifier: Apache-2.0
// Tests OBJ and MTL: the words that programs write, and that damaged files are refused with the
// line, the reason and the remedy.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "base/file.h"
#include "frames/image_io.h"
#include "render/loaders/formats.h"
#include "render/loaders/load_scene.h"
#include "render/loaders/scene_files.h"
#include "tests/support/error_matchers.h"
#include "tests/support/gltf_model.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/texels.h"

namespace lenticule::render {
namespace {

using test::error_of;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

const std::string kCorners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";
const std::string kTriangle = kCorners + "usemtl m\nf 1/1 2/2 3/3\n";

SceneDescription parse(const std::string& text, const std::filesystem::path& file = "model.obj") {
  return parse_obj({reinterpret_cast<const uint8_t*>(text.data()), text.size()}, file);
}

double area_of(const SceneDescription& scene) {
  double sum = 0.0;
  for (const TriangleMesh& mesh : scene.meshes)
    for (const auto& [a, b, c] : mesh.triangles)
      sum += length(cross(mesh.positions[b] - mesh.positions[a],
                          mesh.positions[c] - mesh.positions[a])) /
             2.0;
  return sum;
}

const PbrMaterial& material_named(const SceneDescription& scene, const std::string& name) {
  for (const Material& material : scene.materials)
    if (material.name == name) return *material.pbr;
  ADD_FAILURE() << "no material " << name;
  return *scene.materials.at(0).pbr;
}

class ObjFiles : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    write_text_file(folder_ / name, text);
    return folder_ / name;
  }
  void write_picture(const std::string& name) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    test::write_bytes(folder_ / name, test::small_png());
  }
  /// Parses a triangle with the material m of these lines.
  SceneDescription with_material(const std::string& lines) const {
    write("m.mtl", "newmtl m\n" + lines);
    return parse("mtllib m.mtl\n" + kTriangle, folder_ / "model.obj");
  }
  PbrMaterial material(const std::string& lines) const {
    return *with_material(lines).materials.at(0).pbr;
  }
  /// Returns the texels of a use's texture.
  static std::vector<float> texels(const SceneDescription& scene, const TextureUse& use) {
    return test::texels_of(*scene.textures.at(static_cast<size_t>(use.texture)));
  }

  test::ScratchFolder folder_;
};

// ---- geometry

TEST_F(ObjFiles, APyramidHasItsMaterialsTexturesAndQuads) {
  const std::filesystem::path file =
      std::filesystem::path(LENTICULE_SOURCE_DIR) / "tests/data/pyramid.obj";
  const SceneDescription scene = parse_obj(read_scene_file(file), file);
  EXPECT_THAT(scene.notes, IsEmpty());
  ASSERT_THAT(scene.meshes, SizeIs(2));
  EXPECT_EQ(scene.meshes[0].triangles.size() + scene.meshes[1].triangles.size(), 6U);
  const PbrMaterial& sides = material_named(scene, "sides");
  EXPECT_EQ(sides.base_colour, (Vec3{0.8, 0.3, 0.1}));
  EXPECT_GE(sides.base_colour_texture.texture, 0);
  EXPECT_EQ(sides.metallic, 0.0);
  EXPECT_TRUE(sides.double_sided);
  EXPECT_LT(material_named(scene, "base").roughness, sides.roughness) << "a larger Ns";
  for (const TriangleMesh& mesh : scene.meshes) {
    EXPECT_THAT(mesh.normals, IsEmpty()) << "no normals in the file: flat";
    for (size_t i = 0; i < mesh.uvs.size(); ++i)
      EXPECT_FLOAT_EQ(mesh.uvs[i][1], mesh.positions[i].y > 1.0 ? 0.0F : 1.0F);
  }
}

TEST(Obj, ReadsTheSameModelHoweverItIsWritten) {
  for (const std::string text :
       {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "\xEF\xBB\xBFv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3",
        "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n", "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r",
        "v 0 0 0 # first\nv 1. .0 -0e3\nv +0 1 0\n\nf 1 2 3 # comment\n",
        "v 0 0 \\\n0\nv 1 0 0\nv 0 1 0\nf 1 2\\\n 3\n",
        "v 0 0 \\\r\n0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 \\\r\n2 3\r\n",
        "  v 0 0 0\n\tv 1 0 0 1.0\nv\t0 1 0 \nf -3 -2 -1\n",
        "o a\ng b c\ns 1\nv 0 0 0\nv 1 0 0\nv 0 1 0\nfo 1// 2/ 3\ns off\n"}) {
    SCOPED_TRACE(text);
    const SceneDescription scene = parse(text);
    EXPECT_THAT(scene.notes, IsEmpty());
    ASSERT_THAT(scene.meshes, SizeIs(1));
    EXPECT_THAT(scene.meshes[0].positions,
                ElementsAre(Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{0, 1, 0}));
    EXPECT_THAT(scene.meshes[0].normals, IsEmpty());
    EXPECT_THAT(scene.meshes[0].uvs, IsEmpty());
  }
}

TEST(Obj, KeepsDigitsAndNumbersWithALeadingDot) {
  const SceneDescription scene = parse("v .5 1000000.0625 -.25\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_EQ(scene.meshes.at(0).positions[0], (Vec3{0.5, 1000000.0625, -0.25}));
}

TEST(Obj, DividesConcavePolygons) {
  const SceneDescription scene =
      parse("v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nf 1 2 3 4 5\n");
  EXPECT_THAT(scene.meshes.at(0).triangles, SizeIs(3));
  EXPECT_NEAR(area_of(scene), 10.0, 1e-12);
}

TEST(Obj, ACornerHasItsOwnTextureCoordinatesAndNormal) {
  const SceneDescription scene = parse(
      kCorners + "vn 0 0 2\nvn nan nan nan\nf 1/3/1 2/2/1 3/1/1\nf 3//2 2//2 1//2\nf 2/1 3 1\n");
  ASSERT_THAT(scene.meshes, SizeIs(2)) << "with and without normals";
  EXPECT_THAT(scene.notes, ElementsAre("3 unusable normals recomputed"));
  const TriangleMesh& flat = scene.meshes[0];
  EXPECT_THAT(flat.normals, IsEmpty());
  EXPECT_THAT(flat.uvs,
              ElementsAre(std::array{0.0F, 1.0F}, std::array{0.0F, 0.0F}, std::array{0.0F, 0.0F}));
  const TriangleMesh& smooth = scene.meshes[1];
  EXPECT_THAT(smooth.normals, ElementsAre(Vec3{0, 0, 1}, Vec3{0, 0, 1}, Vec3{0, 0, 1},
                                          Vec3{0, 0, -1}, Vec3{0, 0, -1}, Vec3{0, 0, -1}));
  EXPECT_THAT(smooth.uvs[0], ElementsAre(0.0F, 0.0F));
}

TEST(Obj, MissingTextureCoordinatesAreNoted) {
  const SceneDescription scene =
      parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\n");
  EXPECT_THAT(scene.meshes.at(0).uvs, IsEmpty());
  EXPECT_THAT(scene.meshes[0].normals, Each(Vec3{0, 0, 1}));
  EXPECT_THAT(scene.notes, ElementsAre(HasSubstr("3 texture coordinates and normals")));
}

TEST(Obj, VertexColoursTakeThePlaceOfTheMaterials) {
  const SceneDescription scene = parse(
      "v 0 0 0 1 0 0\nv 1 0 0 0 0.5 0\nv 0 1 0\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf 1 2 3\nf 4 5 6\n");
  ASSERT_THAT(scene.meshes, SizeIs(2));
  EXPECT_THAT(scene.meshes[0].colours, IsEmpty());
  const TriangleMesh& coloured = scene.meshes[1];
  EXPECT_THAT(coloured.colours[0], ElementsAre(1.0F, 0.0F, 0.0F, 1.0F));
  EXPECT_NEAR(coloured.colours[1][1], 0.214F, 1e-3) << "decoded from sRGB";
  EXPECT_THAT(coloured.colours[2], ElementsAre(1.0F, 1.0F, 1.0F, 1.0F)) << "states none";
  EXPECT_EQ(scene.materials.at(static_cast<size_t>(coloured.material)).pbr->base_colour,
            (Vec3{1, 1, 1}));
}

TEST(Obj, WhatIsNoPolygonIsNoted) {
  const SceneDescription scene =
      parse(kCorners +
            "p 1\nl 1 2\nf 1 2\nvp 0.5\ncstype bezier\ndeg 1\ncurv 0 1 1 2\nsurf 0 1 0 1 1 2 3\n"
            "end\ncall other.obj\nf 1 2 3\nf 1 1 2\n");
  EXPECT_THAT(scene.meshes.at(0).triangles, SizeIs(1));
  EXPECT_THAT(scene.notes,
              ElementsAre("1 triangles without an area dropped", "points and lines left out",
                          "free-form surfaces or unknown lines left out: 'call', 'cstype', 'curv', "
                          "'deg', 'surf'"));
}

TEST(Obj, DamagedFilesAreRefusedWithTheLineAndARemedy) {
  const std::tuple<std::string, const char*, const char*> files[] = {
      {"v 0,5 0 0\nf 1 1 1\n",
       "model.obj:1: a coordinate must have a decimal point, not the comma of '0,5'",
       "decimal points"},
      {kCorners + "f 1 2 4\n", "model.obj:7: '4' names none of the 3 vertices so far", "export"},
      {kCorners + "f 1 2 -4\n", "model.obj:7: '-4' names none", "export"},
      {kCorners + "f 0 1 2\n", "model.obj:7: '0' names none", "export"},
      {kCorners + "f 1 2 99999999999999999999\n", "model.obj:7: '99999999999999999999' is not",
       "export"},
      {kCorners + "f 1/x 2 3\n", "model.obj:7: 'x' is not an index", "export"},
      {kCorners + "f 1 \\\n2 9\n", "model.obj:8: '9' names none", "export"},
      {"\xFE\xFF", "model.obj: is UTF-16 text", "UTF-8"},
      {"\xFF\xFEv", "model.obj: is UTF-16 text", "UTF-8"},
      {"v 1 2\n", "model.obj:1: the file ends before a coordinate", "export"},
      {"v 1 two 3\n", "model.obj:1: a coordinate must be a finite number, not 'two'", "export"},
      {"\n\nv inf 0 0\n", "model.obj:3: a coordinate must be a finite number", "export"},
      {"v 1e16 0 0\n", "model.obj:1: a coordinate must lie in -1e+15..1e+15", "export"}};
  for (const auto& [text, reason, remedy] : files)
    test::expect_error(error_of([&text = text] { (void)parse(text); }), ErrorKind::Input, reason,
                       remedy);
  std::string many = kCorners + "f";
  for (int n = 0; n < 10001; ++n) many += " 1";
  test::expect_error(error_of([&] { (void)parse(many); }), ErrorKind::Input,
                     "model.obj:7: more than 10000 corners of a face", "divide the model");
}

// ---- materials

TEST_F(ObjFiles, DissolveIsTheShareThatASurfaceCovers) {
  // The materials of a glTF file that viewers show alike: alphaMode BLEND, alpha as stated here.
  write("dissolve.mtl",
        "newmtl red\nKd 0.9 0.05 0.05\nd 1\nnewmtl smoke\nKd 0 0 0\nd 0.3\nillum 2\nKs 0 0 0\n"
        "newmtl blue\nKd 0.1 0.1 0.9\nTr 0.6\nillum 7\nNi 1.5\n"
        "newmtl both\nKd 1 1 1\nTr 1\nd 0.5\n");
  const SceneDescription scene = parse("mtllib dissolve.mtl\n" + kCorners +
                                           "usemtl red\nf 1 2 3\nusemtl smoke\nf 1 2 3\n"
                                           "usemtl blue\nf 1 2 3\nusemtl both\nf 1 2 3\n",
                                       folder_ / "dissolve.obj");
  EXPECT_THAT(scene.notes, IsEmpty());
  EXPECT_EQ(material_named(scene, "red").alpha_mode, PbrMaterial::AlphaMode::Opaque);
  for (const auto& [name, alpha] : {std::pair{"smoke", 0.3}, {"blue", 0.4}, {"both", 0.5}}) {
    const PbrMaterial& m = material_named(scene, name);
    EXPECT_EQ(m.alpha_mode, PbrMaterial::AlphaMode::Blend) << name;
    EXPECT_NEAR(m.alpha, alpha, 1e-9) << name;
    EXPECT_EQ(m.transmission, 0.0) << name;
  }
  EXPECT_EQ(material_named(scene, "smoke").base_colour, (Vec3{0, 0, 0}));
}

TEST_F(ObjFiles, KsGivesTheReflectionOfADielectric) {
  const SceneDescription shiny = with_material("Kd 1 1 1\nKs 0.5 0.5 0.5\nNs 50\n");
  EXPECT_EQ(shiny.materials.at(0).pbr->specular, 1.0);
  EXPECT_EQ(shiny.materials.at(0).pbr->ior, 1.5)
      << "with 1, light would be reflected at the edges only";
  EXPECT_EQ(with_material("Kd 1 1 1\n").materials.at(0).pbr->specular, 0.0);
}

TEST_F(ObjFiles, AMaskGivesTheColourItsAlpha) {
  write_picture("alpha.png");  // red, green, blue with alpha 128, grey
  const SceneDescription cut = with_material("Kd 1 1 1\nmap_Kd alpha.png\nmap_d alpha.png\n");
  const PbrMaterial& m = *cut.materials.at(0).pbr;
  EXPECT_EQ(m.alpha_mode, PbrMaterial::AlphaMode::Blend);
  EXPECT_EQ(m.alpha, 1.0);
  const std::vector<float> t = texels(cut, m.base_colour_texture);
  EXPECT_THAT((std::vector{t[0], t[3], t[6 + 4], t[11]}),
              ElementsAre(1.0F, 1.0F, 1.0F, 128.0F / 255.0F))
      << "its alpha where the picture has one";
  EXPECT_THAT(cut.textures, SizeIs(1));
  EXPECT_FALSE(cut.textures[0]->codes.empty()) << "8 bits stay 8 bits";

  frames::WovenFrame grey({.width = 4, .height = 1});
  for (size_t n = 0; n < grey.bytes().size(); ++n)
    grey.bytes()[n] = static_cast<uint8_t>(n / 3 * 85);
  frames::write_woven(grey.view(), folder_ / "grey.png");
  const SceneDescription faded = with_material("Kd 1 1 1\nmap_d grey.png\nd 0.5\n");
  const std::vector<float> g = texels(faded, faded.materials.at(0).pbr->base_colour_texture);
  EXPECT_THAT((std::vector{g[0], g[3], g[7], g[11], g[15]}),
              ElementsAre(1.0F, 0.0F, 85.0F / 255.0F, 170.0F / 255.0F, 1.0F))
      << "otherwise the green of the picture, as it is stored";
  EXPECT_EQ(faded.materials[0].pbr->alpha, 0.5);
}

TEST_F(ObjFiles, AMissingMaskLeavesTheColour) {
  write_picture("wood.png");
  const SceneDescription scene = with_material("map_Kd wood.png\nmap_d none.png\n");
  EXPECT_THAT(scene.notes, Contains(HasSubstr("none.png")));
  ASSERT_GE(scene.materials.at(0).pbr->base_colour_texture.texture, 0);
  EXPECT_EQ(texels(scene, scene.materials[0].pbr->base_colour_texture)[0], 1.0F);
}

TEST_F(ObjFiles, OptionsOfMapsAreReadOrSkipped) {
  write_picture("wood grain.png");
  const PbrMaterial m = material(
      "map_Kd -bm 2 -clamp on -blendu off -blendv on -mm 0 1 -t 1 1 1 -texres 64 -imfchan r -cc on "
      "-boost 3 -type sphere -s 4 2 1 -o 0.25 0.5 wood grain.png\n");
  ASSERT_GE(m.base_colour_texture.texture, 0);
  // Texture coordinates of the file, v upward: 4 u + 0.25, 2 v + 0.5.
  EXPECT_THAT(m.base_colour_texture.uv_map, ElementsAre(4.0, 0.0, 0.25, 0.0, 2.0, -1.5));
  const PbrMaterial one = material("map_Kd -o .5 -s 2 wood grain.png\n");
  EXPECT_THAT(one.base_colour_texture.uv_map, ElementsAre(2.0, 0.0, 0.5, 0.0, 1.0, 0.0));
}

TEST_F(ObjFiles, WordsWithoutAnEffectAreNotedOnceForMaterialsInUse) {
  for (const auto& [line, word] : {std::pair<std::string, std::string>{"aniso 0.5", "'aniso'"},
                                   {"anisor 0.5", "'anisor'"},
                                   {"d -halo 0.5", "'d -halo'"},
                                   {"Kd xyz 0.3 0.3 0.3", "'Kd xyz'"},
                                   {"Kd spectral red.rfl", "'Kd spectral'"},
                                   {"Kd 0,3 0,3 0,3", "'Kd 0,3'"},
                                   {"map_Bump -bm 0.2 bump.png", "'map_Bump'"},
                                   {"whatever", "'whatever'"}}) {
    const SceneDescription scene = with_material("Kd 1 0 0\n" + line + "\n" + line + "\n");
    EXPECT_THAT(scene.notes, ElementsAre("ignored in materials: " + word));
    EXPECT_EQ(scene.materials.at(0).pbr->base_colour, (Vec3{1, 0, 0})) << line;
    EXPECT_EQ(scene.materials[0].pbr->alpha_mode, PbrMaterial::AlphaMode::Opaque) << line;
  }
  EXPECT_THAT(
      with_material("Ka 1 1 1\nTf 1 1 1\nillum 2\nsharpness 60\nnewmtl other\naniso 1\n").notes,
      IsEmpty());
}

TEST_F(ObjFiles, AMaterialThatIsMissingIsGrey) {
  write("c.mtl", "newmtl m\nKd 1 0 0\n");
  const SceneDescription scene =
      parse("mtllib c.mtl gone.mtl\n" + kCorners + "usemtl none\nf 1 2 3\n", folder_ / "c.obj");
  EXPECT_THAT(scene.notes, ElementsAre(HasSubstr("gone.mtl"),
                                       "materials that no MTL file has, shown in grey: 'none'"));
  const Vec3 grey = scene.materials.at(0).pbr->base_colour;
  EXPECT_TRUE(grey.x == grey.y && grey.y == grey.z && grey.x > 0.0);
}

TEST_F(ObjFiles, ALineNamesSeveralMtlFilesAndNamesHaveSpaces) {
  write("a b.mtl", "newmtl one\nKd 1 0 0\n");
  write("c.MTL", "\xEF\xBB\xBFnewmtl  two words \r\nKd 0.5\r\n");
  const SceneDescription scene = parse("mtllib a b.mtl ./c.MTL\nmtllib a b.mtl\n" + kCorners +
                                           "usemtl one\nf 1 2 3\nusemtl two words\nf 1 2 3\n",
                                       folder_ / "model.obj");
  EXPECT_THAT(scene.notes, IsEmpty());
  EXPECT_EQ(material_named(scene, "one").base_colour, (Vec3{1, 0, 0}));
  EXPECT_EQ(material_named(scene, "two words").base_colour, (Vec3{0.5, 0.5, 0.5}));
}

TEST_F(ObjFiles, TexturesLieBesideTheirMtlFile) {
  write("mats/a.mtl", "newmtl m\nmap_Kd t.png\n");
  write_picture("mats/t.png");
  const SceneDescription scene = parse("mtllib mats\\a.mtl\n" + kTriangle, folder_ / "a.obj");
  EXPECT_THAT(scene.textures, SizeIs(1)) << ::testing::PrintToString(scene.notes);
  write("b.mtl", "newmtl m\nmap_Kd mats/t.png\n");
  EXPECT_THAT(parse("mtllib b.mtl\n" + kTriangle, folder_ / "b.obj").textures, SizeIs(1));
}

TEST_F(ObjFiles, ADamagedTextureIsLeftOutWithANote) {
  write("t.tif", "II*");
  const SceneDescription scene = with_material("Kd 0 1 0\nmap_Kd t.tif\n");
  EXPECT_THAT(scene.notes, ElementsAre(HasSubstr("t.tif")));
  EXPECT_EQ(scene.materials.at(0).pbr->base_colour, (Vec3{0, 1, 0}));
}

TEST_F(ObjFiles, EmissionMayBeATextureAlone) {
  write_picture("glow.png");
  EXPECT_EQ(material("map_Ke glow.png\n").emission, (Vec3{1, 1, 1}));
  EXPECT_EQ(material("Ke 3 2 1\n").emission, (Vec3{3, 2, 1}));
}

}  // namespace
}  // namespace lenticule::render
