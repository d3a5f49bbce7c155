// SPDX-License-Identifier: Apache-2.0
// Tests models as programs write them: OBJ far from the origin, MTL with metallic-roughness,
// opacity, names in another case, up axes, vertex colours.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "render/loaders/load_scene.h"
#include "render/loaders/textures.h"
#include "tests/support/error_matchers.h"
#include "tests/support/gltf_model.h"
#include "tests/support/texels.h"

namespace lenticule::render {
namespace {

using test::error_of;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

class ModelFiles : public ::testing::Test {
 protected:
  ModelFiles() { std::filesystem::create_directories(folder_); }
  ~ModelFiles() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  std::filesystem::path write(const std::string& name, const std::vector<uint8_t>& bytes) const {
    return write(name, std::string(bytes.begin(), bytes.end()));
  }

  const std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) / ("model-files-" + std::to_string(::getpid()));
};

const std::string kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";
const std::string kFace = "f 1/1 2/2 3/3\n";

void expect_near(Vec3 a, Vec3 b, double tolerance) {
  EXPECT_LT(length(a - b), tolerance) << a.x << ' ' << a.y << ' ' << a.z;
}

// ---- OBJ

TEST_F(ModelFiles, AnObjFarFromTheOriginKeepsItsDigits) {
  const SceneDescription moved =
      load_scene(write("moved.obj",
                       "v 10000000.125 20000000.25 -30000000.5\nv 10000001.125 20000000.25 "
                       "-30000000.5\r\nv 10000000.125 20000001.375 -30000000.5\nf 1 2 3\n"));
  ASSERT_THAT(moved.meshes, SizeIs(1));
  expect_near(moved.meshes[0].positions[0], {10000000.125, 20000000.25, -30000000.5}, 1e-6);
  expect_near(moved.meshes[0].positions[1], {10000001.125, 20000000.25, -30000000.5}, 1e-6);
  expect_near(moved.meshes[0].positions[2], {10000000.125, 20000001.375, -30000000.5}, 1e-6);
  EXPECT_THAT(moved.notes, Not(Contains(HasSubstr("single precision"))));
}

TEST_F(ModelFiles, AnObjNearTheOriginIsReadAsItIs) {
  const SceneDescription scene = load_scene(write("near.obj", kTriangle + kFace));
  EXPECT_EQ(scene.meshes.at(0).positions[1], (Vec3{1, 0, 0}));
}

TEST_F(ModelFiles, MtlStatesMetallicRoughness) {
  write("skin.png", test::small_png());
  write("paint.mtl",
        "newmtl paint\nKd 0.5 0.25 0.125\nPr 0.375\nPm 0.75\nKe 2 1 0\n"
        "map_Pr skin.png\nnorm skin.png\nmap_Ke skin.png\n");
  const SceneDescription scene =
      load_scene(write("model.obj", "mtllib paint.mtl\n" + kTriangle + "usemtl paint\n" + kFace));
  const Material& material = scene.materials.at(static_cast<size_t>(scene.meshes.at(0).material));
  ASSERT_TRUE(material.pbr);
  EXPECT_EQ(material.pbr->base_colour, (Vec3{0.5, 0.25, 0.125}));
  EXPECT_NEAR(material.pbr->roughness, 0.375, 1e-6);
  EXPECT_NEAR(material.pbr->metallic, 0.75, 1e-6);
  expect_near(material.pbr->emission, {2, 1, 0}, 1e-6);
  EXPECT_TRUE(material.pbr->double_sided);
  ASSERT_GE(material.pbr->normal_texture.texture, 0);
  ASSERT_GE(material.pbr->emission_texture.texture, 0);
  ASSERT_GE(material.pbr->metallic_roughness_texture.texture, 0);
  const std::vector<float> rough = test::texels_of(
      *scene.textures[static_cast<size_t>(material.pbr->metallic_roughness_texture.texture)],
      frames::TextureContent::Data);
  EXPECT_NEAR(rough.at(13), 188.0 / 255.0, 1e-6) << "roughness in green, as data";
  EXPECT_EQ(rough.at(14), 1.0F) << "no texture of metalness";
  EXPECT_THAT(scene.meshes[0].tangents, SizeIs(3)) << "for the normal texture";
}

// ---- file names

TEST_F(ModelFiles, NamesMayDifferInTheCaseOfLetters) {
  write("Textures/Wood.PNG", test::small_png());
  write("Paint.MTL", "newmtl paint\nKd 1 1 1\nmap_Kd textures\\wood.png\n");
  const SceneDescription scene =
      load_scene(write("model.obj", "mtllib paint.mtl\n" + kTriangle + "usemtl paint\n" + kFace));
  EXPECT_THAT(scene.textures, SizeIs(1)) << ::testing::PrintToString(scene.notes);
}

TEST_F(ModelFiles, AnExactNameComesFirst) {
  write("a.png", "1");
  write("A.png", "2");
  EXPECT_EQ(named_file(folder_, "A.png"), folder_ / "A.png");
  EXPECT_EQ(named_file(folder_, "a.png"), folder_ / "a.png");
}

TEST_F(ModelFiles, NamesMayBePercentEncoded) {
  write("two words.png", "1");
  EXPECT_EQ(named_file(folder_, "two%20words.png"), folder_ / "two words.png");
}

TEST_F(ModelFiles, APathOfAnotherMachineIsFoundBesideTheScene) {
  write("wood.png", "1");
  EXPECT_EQ(named_file(folder_, "C:\\models\\wood.png"), folder_ / "wood.png");
}

TEST_F(ModelFiles, AGltfReadsItsBufferAndPictureBesideIt) {
  test::GltfModel model;
  write("Data/model.bin", model.buffer());
  write("two words.png", test::small_png());
  model.json["images"] = {{{"uri", "two%20words.png"}}};
  model.json["textures"] = {{{"source", 0}}};
  model.material()["pbrMetallicRoughness"] = {{"baseColorTexture", {{"index", 0}}}};
  nlohmann::json whole = model.json;
  whole["buffers"] = {{{"uri", "Data/model.bin"}, {"byteLength", model.buffer().size()}}};
  const SceneDescription scene = load_scene(write("model.gltf", whole.dump()));
  EXPECT_THAT(scene.textures, SizeIs(1)) << ::testing::PrintToString(scene.notes);
  EXPECT_THAT(scene.meshes.at(0).positions, SizeIs(4));
  std::vector<uint8_t> cut = test::small_png();
  cut.resize(cut.size() / 2);
  write("two words.png", cut);
  EXPECT_THAT(load_scene(folder_ / "model.gltf").notes, ElementsAre(HasSubstr("two%20words.png")));
}

// ---- materials

TEST_F(ModelFiles, AGltfIsNotedForTheMaterialsThatAreSeenOnly) {
  test::GltfModel model;
  model.json["images"] = {{{"uri", "none.png"}}};
  model.json["textures"] = {{{"source", 0}}};
  model.material()["pbrMetallicRoughness"] = {{"baseColorTexture", {{"index", 0}}}};
  model.json["materials"].push_back(model.json["materials"][0]);
  const auto notes = [&] {
    nlohmann::json whole = model.json;
    whole["buffers"] = {{{"uri", "model.bin"}, {"byteLength", model.buffer().size()}}};
    write("model.bin", model.buffer());
    return load_scene(write("model.gltf", whole.dump())).notes;
  };
  model.primitive()["material"] = 1;
  model.json["meshes"].push_back(model.json["meshes"][0]);
  model.json["meshes"][1]["primitives"][0]["material"] = 0;
  model.add_node({{"mesh", 1}});
  EXPECT_THAT(notes(), ElementsAre(HasSubstr("none.png"))) << "once, for both";
  model.json["meshes"][1]["primitives"][0].erase("material");
  model.primitive().erase("material");
  EXPECT_THAT(notes(), IsEmpty());
  model.json["scenes"][0]["nodes"] = {0};
  model.json["meshes"][1]["primitives"][0]["material"] = 0;
  EXPECT_THAT(notes(), IsEmpty()) << "used by a node that is not shown";
}

// ---- up axes

const std::string kPly =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 0 2\n3 0 1 2\n";

TEST_F(ModelFiles, PlyAndStlHaveZUpByHabit) {
  const SceneDescription ply = load_scene(write("up.ply", kPly));
  expect_near(ply.meshes.at(0).positions[2], {0, 2, 0}, 1e-9);
  EXPECT_THAT(ply.notes, Contains(HasSubstr("z is taken as up")));
  const SceneDescription stl =
      load_scene(write("up.stl",
                       "solid a\nfacet normal 0 1 0\nouter loop\nvertex 0 0 0\nvertex 0 0 3\n"
                       "vertex 1 0 0\nendloop\nendfacet\nendsolid a\n"));
  expect_near(stl.meshes.at(0).positions[1], {0, 3, 0}, 1e-9);
}

template <class T>
void append(std::string& to, std::initializer_list<T> values) {
  for (const T value : values)
    to.append(reinterpret_cast<const char*>(&value), sizeof value);  // files are little endian
}

/// Returns a chunk of a 3DS file: number, length, content.
std::string chunk(uint16_t number, const std::string& content) {
  std::string bytes;
  append<uint16_t>(bytes, {number});
  append<uint32_t>(bytes, {static_cast<uint32_t>(content.size() + 6)});
  return bytes + content;
}

/// Returns a 3DS file of one triangle, whose height is 4 along z. Chunks of materials come before
/// it, and chunks about its face after the face.
std::string triangle_3ds(const std::string& materials = {}, const std::string& about_face = {}) {
  std::string vertices;
  append<uint16_t>(vertices, {3});
  append<float>(vertices, {0, 0, 0, 1, 0, 0, 0, 0, 4});
  std::string faces;
  append<uint16_t>(faces, {1, 0, 1, 2, 0});
  const std::string mesh =
      chunk(0x4100, chunk(0x4110, vertices) + chunk(0x4120, faces + about_face));
  return chunk(0x4D4D, chunk(0x3D3D, materials + chunk(0x4000, std::string("a\0", 2) + mesh)));
}

TEST_F(ModelFiles, A3dsHasZUpWhateverItsLoaderDoes) {
  const std::filesystem::path file = write("up.3ds", triangle_3ds());
  const auto highest = [&](const LoadOptions& options) {
    const SceneDescription scene = load_scene(file, options);
    double high = 0.0;
    for (const Vec3& p : scene.meshes.at(0).positions) high = std::max(high, p.y);
    return high;
  };
  EXPECT_NEAR(highest({}), 4.0, 1e-6);
  EXPECT_NEAR(highest({.up = UpAxis::Z}), 4.0, 1e-6);
  EXPECT_NEAR(highest({.up = UpAxis::X}), 1.0, 1e-6);
  EXPECT_NEAR(highest({.up = UpAxis::Y}), 0.0, 1e-6);
}

TEST_F(ModelFiles, AnFbxStatesItsUpAxis) {
  const auto highest = [&](int axis) {
    const SceneDescription scene = load_scene(write(
        "up.fbx",
        "; FBX 7.4.0 project file\n"
        "FBXHeaderExtension:  {\nFBXHeaderVersion: 1003\nFBXVersion: 7400\n}\n"
        "GlobalSettings:  {\nVersion: 1000\nProperties70:  {\n"
        "P: \"UpAxis\", \"int\", \"Integer\", \"\"," +
            std::to_string(axis) +
            "\n}\n}\n"
            "Definitions:  {\nVersion: 100\nCount: 0\n}\n"
            "Objects:  {\nGeometry: 1, \"Geometry::\", \"Mesh\" {\n"
            "Vertices: *9 {\na: 0,0,0,1,0,0,0,2,4\n}\nPolygonVertexIndex: *3 {\na: 0,1,-3\n}\n}\n"
            "Model: 2, \"Model::a\", \"Mesh\" {\nVersion: 232\n}\n}\n"
            "Connections:  {\nC: \"OO\",2,0\nC: \"OO\",1,2\n}\n"));
    double high = 0.0;
    for (const Vec3& p : scene.meshes.at(0).positions) high = std::max(high, p.y);
    return high;
  };
  EXPECT_NEAR(highest(1), 2.0, 1e-6);
  EXPECT_NEAR(highest(2), 4.0, 1e-6);
}

// ---- formats

TEST_F(ModelFiles, FormatsWhoseReaderCrashesAreReadOnRequestOnly) {
  const std::filesystem::path file = write("a.prj", triangle_3ds());
  test::expect_error(error_of([&] { (void)load_scene(file); }), ErrorKind::Input,
                     "a.prj: models in .prj are not read", "convert it to glTF");
  EXPECT_THAT(load_scene(file, {.any_format = true}).meshes, SizeIs(1));
  for (const char* name : {"a.md2", "a.MD3", "a.md5mesh", "a.mdc", "a.mdl", "a.ndo", "a.csm", "a.x",
                           "a.ogex", "a.hmp", "a.3mf"})
    test::expect_error(error_of([&] { (void)load_scene(write(name, "text")); }), ErrorKind::Input,
                       "are not read", "--any-format");
}

TEST_F(ModelFiles, AnOffIsReadWithAnyHeader) {
  const std::string kBody = "3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  for (const std::string& file : {"OFF\n" + kBody, "# comment\nOFF " + kBody, kBody}) {
    SCOPED_TRACE(file);
    EXPECT_THAT(load_scene(write("a.off", file)).meshes, SizeIs(1));
  }
}

TEST_F(ModelFiles, AnOffWithoutRoomForWhatItCountsIsRefused) {
  const std::string kBody = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  for (const char* head :
       {"OFF\n1300000000 6 0\n", "OFF 3 1300000000 0\n", "nOFF 3\n1300000000 6 0\n",
        "4OFF 1300000000 6 0\n", "1300000000 6 0\n", "OFF BINARY\n", "OFF\n-1 6 0\n",
        "OFF 99999999999999999999 1 0\n", "OFF\n"})
    test::expect_error(error_of([&] { (void)load_scene(write("a.off", head + kBody)); }),
                       ErrorKind::Input, "a.off:", "save it again");
}

TEST_F(ModelFiles, ErrorsOfBrokenFilesHaveARemedy) {
  const std::pair<const char*, const char*> kBroken[] = {
      {"a.stl", "solid a\nfacet"},
      {"a.stl", "none"},
      {"a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"},
      {"a.ply", "ply\n"},
      {"a.nff", "s 0 0 0\n"},
      {"a.glb", "glTF"}};
  for (const auto& broken : kBroken)
    EXPECT_THAT(
        error_of([&] { (void)load_scene(write(broken.first, std::string(broken.second))); }).hint(),
        Not(IsEmpty()))
        << broken.first << ' ' << broken.second;
}

TEST(Textures, ATextureThatWasReducedIsNotedOnce) {
  SceneDescription scene;
  Textures textures(scene);
  const auto decode = [] {
    return frames::TextureImage{.width = 1, .height = 1, .codes = {1, 2, 3, 4}, .reduced = 2};
  };
  EXPECT_EQ(textures.add({.name = "wood.png"}, decode), 0);
  EXPECT_EQ(textures.add({.name = "wood.png", .content = frames::TextureContent::Data}, decode), 1);
  EXPECT_THAT(
      scene.notes,
      ElementsAre("texture reduced to 1 x 1 texels, 1/2 of its width and height: wood.png"));
}

TEST_F(ModelFiles, ATextureOf3dsTakesThePlaceOfTheColour) {
  const std::string content = chunk(0xA000, std::string("paint\0", 6)) +
                              chunk(0xA020, chunk(0x0011, "\x33\x66\xFF")) +
                              chunk(0xA200, chunk(0xA300, std::string("wood.png\0", 9)));
  std::string use("paint\0", 6);
  append<uint16_t>(use, {1, 0});
  const auto file = write("a.3ds", triangle_3ds(chunk(0xAFFF, content), chunk(0x4130, use)));
  const auto colour = [&] {
    const SceneDescription scene = load_scene(file);
    return scene.materials.at(static_cast<size_t>(scene.meshes.at(0).material)).colour;
  };
  expect_near(colour(), {0.2, 0.4, 1}, 1e-6);  // the picture is missing
  write("wood.png", test::small_png());
  expect_near(colour(), {1, 1, 1}, 1e-6);
}

TEST_F(ModelFiles, AMaterialThatNoMeshUsesIsNotNoted) {
  const std::string map = chunk(0xA200, chunk(0xA300, std::string("none.png\0", 9)));
  const std::string material = chunk(0xAFFF, chunk(0xA000, std::string("paint\0", 6)) + map);
  std::string use("paint\0", 6);
  append<uint16_t>(use, {1, 0});
  EXPECT_THAT(load_scene(write("a.3ds", triangle_3ds(material, chunk(0x4130, use)))).notes,
              Contains(HasSubstr("none.png")));
  EXPECT_THAT(load_scene(write("b.3ds", triangle_3ds(material))).notes,
              Not(Contains(HasSubstr("none.png"))));
}

/// Returns a triangle whose material has these elements.
std::string collada(const std::string& phong) {
  return R"(<?xml version="1.0"?><COLLADA version="1.4.1" xmlns="http://www.collada.org/2005/11/COLLADASchema">
<library_effects><effect id="e"><profile_COMMON><technique sid="c"><phong>)" +
         phong + R"(</phong></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common>
<accessor source="#pa" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1" material="m"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"><bind_material>
<technique_common><instance_material symbol="m" target="#m"/></technique_common></bind_material>
</instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>)";
}

TEST_F(ModelFiles, OpacityOfColladaIsTheShareThatASurfaceCovers) {
  const SceneDescription scene =
      load_scene(write("glass.dae", collada(R"(<diffuse><color>0.1 0.1 0.9 1</color></diffuse>
<transparent opaque="A_ONE"><color>1 1 1 1</color></transparent>
<transparency><float>0.4</float></transparency>)")));
  const Material& material = scene.materials.at(static_cast<size_t>(scene.meshes.at(0).material));
  ASSERT_TRUE(material.pbr);
  EXPECT_EQ(material.pbr->alpha_mode, PbrMaterial::AlphaMode::Blend);
  EXPECT_NEAR(material.pbr->alpha, 0.4, 1e-6);
  EXPECT_EQ(material.pbr->transmission, 0.0);
  expect_near(material.pbr->base_colour, {0.1, 0.1, 0.9}, 1e-6);
}

TEST_F(ModelFiles, ASurfaceThatWouldNotBeSeenAtAllIsOpaque) {
  const SceneDescription scene =
      load_scene(write("opaque.dae", collada(R"(<diffuse><color>0.1 0.1 0.9 1</color></diffuse>
<transparent opaque="A_ONE"><color>1 1 1 1</color></transparent>
<transparency><float>0</float></transparency>)")));
  const Material& material = scene.materials.at(static_cast<size_t>(scene.meshes.at(0).material));
  EXPECT_TRUE(!material.pbr || material.pbr->alpha == 1.0);
}

TEST_F(ModelFiles, AnObjHasYUpWithANote) {
  const SceneDescription scene = load_scene(write("up.obj", kTriangle + kFace));
  expect_near(scene.meshes.at(0).positions[2], {0, 1, 0}, 1e-9);
  EXPECT_THAT(scene.notes, Contains(HasSubstr("--up z")));
}

TEST_F(ModelFiles, TheUserMayStateTheUpAxis) {
  const std::filesystem::path ply = write("up.ply", kPly);
  const auto third = [&](const char* axis) {
    const SceneDescription scene = load_scene(ply, {.up = up_axis_named(axis)});
    EXPECT_THAT(scene.notes, IsEmpty());
    return scene.meshes.at(0).positions[2];
  };
  expect_near(third("y"), {0, 0, 2}, 1e-9);
  expect_near(third("z"), {0, 2, 0}, 1e-9);
  expect_near(third("-z"), {0, -2, 0}, 1e-9);
  EXPECT_THAT(error_of([] { (void)up_axis_named("up"); }).what(), HasSubstr("--up 'up'"));
}

TEST(UpAxis, EveryAxisPointsUpAfterTheTurn) {
  const std::vector<std::pair<const char*, Vec3>> axes{{"x", {1, 0, 0}},   {"y", {0, 1, 0}},
                                                       {"z", {0, 0, 1}},   {"-x", {-1, 0, 0}},
                                                       {"-y", {0, -1, 0}}, {"-z", {0, 0, -1}}};
  for (const auto& [name, axis] : axes) {
    SceneDescription scene;
    Sphere sphere;
    sphere.centre = axis;
    scene.spheres = {sphere};
    TriangleMesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}};
    mesh.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
    scene.meshes = {mesh};
    turn_upright(scene, up_axis_named(name));
    expect_near(scene.spheres[0].centre, {0, 1, 0}, 1e-12);
    const auto& p = scene.meshes[0].positions;
    expect_near(cross(p[1], p[2]), scene.meshes[0].normals[0], 1e-12);
  }
}

TEST(UpAxis, TurnsNodesThatMove) {
  test::GltfModel model;
  model.animate(0, "translation", {0, 1}, {0, 0, 0, 0, 0, 2}, "VEC3");
  const auto file =
      std::filesystem::path(::testing::TempDir()) / ("up-" + std::to_string(::getpid()) + ".glb");
  const std::vector<uint8_t> bytes = model.glb();
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  const SceneDescription scene = load_scene(file, {.up = UpAxis::Z});
  std::filesystem::remove(file);
  expect_near(at_time(scene, 1.0).meshes.at(0).positions[0], {0, 2, 0}, 1e-6);
  expect_near(at_time(scene, 0.0).meshes.at(0).positions[2], {1, 0, -1}, 1e-6);
}

}  // namespace
}  // namespace lenticule::render
