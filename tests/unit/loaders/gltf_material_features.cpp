// SPDX-License-Identifier: Apache-2.0
// Features of glTF: materials, their textures and extensions.
#include <numbers>
#include <string>

#include "tests/support/texels.h"
#include "tests/unit/loaders/gltf_features.h"

namespace lenticule::render {
namespace {

using nlohmann::json;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using namespace lenticule::test;

/// Sets an extension of the material and names it as used.
void set_extension(GltfModel& model, const std::string& name, const json& content) {
  model.material()["extensions"][name] = content;
  model.json["extensionsUsed"].push_back(name);
}

}  // namespace

std::vector<GltfFeatureCase> gltf_material_features() {
  return {
      {"CoreFactors",
       [](GltfModel& m) {
         m.material()["pbrMetallicRoughness"] = {{"baseColorFactor", {0.25, 0.5, 0.75, 0.5}},
                                                 {"metallicFactor", 0.125},
                                                 {"roughnessFactor", 0.375}};
         m.material()["emissiveFactor"] = {0.5, 0.25, 0};
         m.material()["alphaMode"] = "BLEND";
         m.material()["doubleSided"] = true;
       },
       [](const SceneDescription& s) {
         const PbrMaterial& p = pbr_of(s);
         EXPECT_EQ(p.base_colour, (Vec3{0.25, 0.5, 0.75}));
         EXPECT_EQ(p.alpha, 0.5);
         EXPECT_EQ(p.metallic, 0.125);
         EXPECT_EQ(p.roughness, 0.375);
         EXPECT_EQ(p.emission, (Vec3{0.5, 0.25, 0}));
         EXPECT_EQ(p.alpha_mode, PbrMaterial::AlphaMode::Blend);
         EXPECT_TRUE(p.double_sided);
         EXPECT_EQ(s.materials[0].transmittance, 0.5) << "Whitted's approximation";
       }},
      {"AlphaMask",
       [](GltfModel& m) {
         m.material()["alphaMode"] = "MASK";
         m.material()["alphaCutoff"] = 0.25;
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(pbr_of(s).alpha_mode, PbrMaterial::AlphaMode::Mask);
         EXPECT_EQ(pbr_of(s).alpha_cutoff, 0.25);
       }},
      {"CoreTextures",
       [](GltfModel& m) {
         const int texture = m.add_texture();
         json& material = m.material();
         material["pbrMetallicRoughness"] = {{"baseColorTexture", texture_info(texture)},
                                             {"metallicRoughnessTexture", texture_info(texture)}};
         material["normalTexture"] = {{"index", texture}, {"scale", 0.5}};
         material["occlusionTexture"] = {{"index", texture}, {"strength", 0.25}};
         material["emissiveTexture"] = texture_info(texture);
       },
       [](const SceneDescription& s) {
         const PbrMaterial& p = pbr_of(s);
         ASSERT_THAT(s.textures, SizeIs(2)) << "as colours and as data";
         EXPECT_EQ(p.base_colour_texture.texture, p.emission_texture.texture);
         EXPECT_EQ(p.normal_texture.texture, p.metallic_roughness_texture.texture);
         EXPECT_EQ(p.normal_texture.texture, p.occlusion_texture.texture);
         EXPECT_EQ(p.normal_scale, 0.5);
         EXPECT_EQ(p.occlusion_strength, 0.25);
         const auto grey = [&](const TextureUse& use, frames::TextureContent content) {
           return test::texels_of(*s.textures[static_cast<size_t>(use.texture)], content)[12];
         };
         EXPECT_NEAR(grey(p.base_colour_texture, frames::TextureContent::Colour), 0.5029, 1e-4)
             << "decoded from sRGB";
         EXPECT_NEAR(grey(p.normal_texture, frames::TextureContent::Data), 188.0 / 255.0, 1e-6)
             << "as it is";
         EXPECT_NEAR(test::texels_of(*s.textures[0])[11], 128.0 / 255.0, 1e-6) << "alpha";
       }},
      {"TheTextureOfTheSecondCoordinates",
       [](GltfModel& m) {
         m.attributes()["TEXCOORD_1"] =
             m.add_accessor(std::vector<float>{0, 0, 0.5F, 0, 0.5F, 0.5F, 0, 0.5F}, "VEC2", kFloat);
         const int texture = m.add_texture();
         m.material()["pbrMetallicRoughness"] = {{"baseColorTexture", texture_info(texture)}};
         m.material()["occlusionTexture"] = {{"index", texture}, {"texCoord", 1}};
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(pbr_of(s).base_colour_texture.uv_set, 0);
         EXPECT_EQ(pbr_of(s).occlusion_texture.uv_set, 1);
         EXPECT_THAT(only_mesh(s).uvs[2], ElementsAre(1.0F, 0.0F));
         EXPECT_THAT(only_mesh(s).uvs2[2], ElementsAre(0.5F, 0.5F));
       }},
      {"ABaseColourWithTheSecondCoordinates",
       [](GltfModel& m) {
         m.attributes()["TEXCOORD_1"] =
             m.add_accessor(std::vector<float>{0, 0, 0.5F, 0, 0.5F, 0.5F, 0, 0.5F}, "VEC2", kFloat);
         m.material()["pbrMetallicRoughness"] = {
             {"baseColorTexture", {{"index", m.add_texture()}, {"texCoord", 1}}}};
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(pbr_of(s).base_colour_texture.uv_set, 0) << "the first set that is used";
         EXPECT_THAT(only_mesh(s).uvs[2], ElementsAre(0.5F, 0.5F));
       }},
      {"SamplersWrap",
       [](GltfModel& m) {
         m.material()["pbrMetallicRoughness"] = {
             {"baseColorTexture",
              texture_info(m.add_texture({{"wrapS", 33071}, {"wrapT", 33648}}))}};
       },
       [](const SceneDescription& s) {
         EXPECT_FALSE(s.textures.at(0)->repeat_u);
         EXPECT_TRUE(s.textures[0]->repeat_v);
         EXPECT_TRUE(s.textures[0]->mirror_v);
         EXPECT_FALSE(s.textures[0]->mirror_u);
       }},
      {"TextureTransform",
       [](GltfModel& m) {
         m.require("KHR_texture_transform");
         json info = texture_info(m.add_texture());
         info["extensions"]["KHR_texture_transform"] = {
             {"offset", {0.5, 0.25}}, {"rotation", std::numbers::pi / 2}, {"scale", {2, 3}}};
         m.material()["pbrMetallicRoughness"] = {{"baseColorTexture", info}};
       },
       [](const SceneDescription& s) {
         const auto& map = pbr_of(s).base_colour_texture.uv_map;
         // (1, 0) turns counter-clockwise, as seen, to (0, -1): v points down.
         EXPECT_NEAR(map[0] * 1 + map[2], 0.5, 1e-9);
         EXPECT_NEAR(map[3] * 1 + map[5], 0.25 - 2, 1e-9);
         EXPECT_NEAR(map[1] * 1 + map[2], 0.5 + 3, 1e-9);
         EXPECT_NEAR(map[4] * 1 + map[5], 0.25, 1e-9);
       }},
      {"WebpTexture",
       [](GltfModel& m) {
         m.require("EXT_texture_webp");
         m.json["images"] = {
             {{"bufferView", m.add_view(small_webp())}, {"mimeType", "image/webp"}}};
         m.json["textures"] = {{{"extensions", {{"EXT_texture_webp", {{"source", 0}}}}}}};
         m.material()["pbrMetallicRoughness"] = {{"baseColorTexture", texture_info(0)}};
       },
       [](const SceneDescription& s) {
         ASSERT_THAT(s.textures, SizeIs(1)) << ::testing::PrintToString(s.notes);
         EXPECT_EQ(s.textures[0]->width, 2);
         EXPECT_NEAR(test::texels_of(*s.textures[0])[11], 128.0 / 255.0, 1e-6);
       }},
      {"Ktx2TexturesWithoutASubstituteAreNoted",
       [](GltfModel& m) {
         m.json["extensionsUsed"] = {"KHR_texture_basisu"};
         m.json["textures"] = {{{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}}};
         m.json["images"] = {{{"uri", "a.ktx2"}}};
         m.material()["pbrMetallicRoughness"] = {{"baseColorTexture", texture_info(0)}};
       },
       [](const SceneDescription& s) {
         EXPECT_THAT(s.textures, IsEmpty());
         EXPECT_THAT(s.notes, Contains(HasSubstr("KTX2 is not read")));
       }},
      {"AMissingPictureIsNoted",
       [](GltfModel& m) {
         m.json["images"] = {{{"uri", "https://example.com/a.png"}}};
         m.json["textures"] = {{{"source", 0}}};
         m.material()["pbrMetallicRoughness"] = {{"baseColorTexture", texture_info(0)}};
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(pbr_of(s).base_colour_texture.texture, -1);
         EXPECT_THAT(s.notes, Contains(HasSubstr("images[0].uri: only files and data URIs")));
       }},
      {"EmissiveStrength",
       [](GltfModel& m) {
         m.material()["emissiveFactor"] = {1, 0.5, 0};
         set_extension(m, "KHR_materials_emissive_strength", {{"emissiveStrength", 4}});
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(pbr_of(s).emission, (Vec3{4, 2, 0}));
       }},
      {"Ior",
       [](GltfModel& m) {
         set_extension(m, "KHR_materials_ior", {{"ior", 1.75}});
       },
       [](const SceneDescription& s) { EXPECT_EQ(pbr_of(s).ior, 1.75); }},
      {"Unlit", [](GltfModel& m) { set_extension(m, "KHR_materials_unlit", json::object()); },
       [](const SceneDescription& s) { EXPECT_TRUE(pbr_of(s).unlit); }},
      {"Clearcoat",
       [](GltfModel& m) {
         const int texture = m.add_texture();
         set_extension(m, "KHR_materials_clearcoat",
                       {{"clearcoatFactor", 0.5},
                        {"clearcoatRoughnessFactor", 0.25},
                        {"clearcoatTexture", texture_info(texture)},
                        {"clearcoatNormalTexture", texture_info(texture)}});
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(pbr_of(s).clearcoat, 0.5);
         EXPECT_EQ(pbr_of(s).clearcoat_roughness, 0.25);
         EXPECT_EQ(pbr_of(s).clearcoat_texture.texture, 0);
         EXPECT_THAT(only_mesh(s).tangents, SizeIs(4));
       }},
      {"Sheen",
       [](GltfModel& m) {
         set_extension(m, "KHR_materials_sheen",
                       {{"sheenColorFactor", {0.5, 0.25, 0.125}}, {"sheenRoughnessFactor", 0.75}});
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(pbr_of(s).sheen_colour, (Vec3{0.5, 0.25, 0.125}));
         EXPECT_EQ(pbr_of(s).sheen_roughness, 0.75);
       }},
      {"Specular",
       [](GltfModel& m) {
         set_extension(m, "KHR_materials_specular",
                       {{"specularFactor", 0.5}, {"specularColorFactor", {2, 1, 0}}});
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(pbr_of(s).specular, 0.5);
         EXPECT_EQ(pbr_of(s).specular_colour, (Vec3{2, 1, 0}));
       }},
      {"TransmissionAndVolume",
       [](GltfModel& m) {
         set_extension(m, "KHR_materials_transmission", {{"transmissionFactor", 0.875}});
         set_extension(m, "KHR_materials_volume",
                       {{"thicknessFactor", 0.5},
                        {"attenuationDistance", 3},
                        {"attenuationColor", {0.5, 1, 1}}});
         m.node()["scale"] = {2, 2, 2};
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(pbr_of(s).transmission, 0.875);
         EXPECT_NEAR(pbr_of(s).thickness, 1.0, 1e-9) << "in the world, the node magnifies it";
         EXPECT_EQ(pbr_of(s).attenuation_distance, 3.0);
         EXPECT_EQ(pbr_of(s).attenuation_colour, (Vec3{0.5, 1, 1}));
       }},
      {"Iridescence",
       [](GltfModel& m) {
         set_extension(m, "KHR_materials_iridescence",
                       {{"iridescenceFactor", 0.5},
                        {"iridescenceIor", 1.5},
                        {"iridescenceThicknessMinimum", 50},
                        {"iridescenceThicknessMaximum", 500}});
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(pbr_of(s).iridescence, 0.5);
         EXPECT_EQ(pbr_of(s).iridescence_ior, 1.5);
         EXPECT_EQ(pbr_of(s).iridescence_thickness_min, 50.0);
         EXPECT_EQ(pbr_of(s).iridescence_thickness_max, 500.0);
       }},
      {"AnisotropyNeedsTangents",
       [](GltfModel& m) {
         set_extension(m, "KHR_materials_anisotropy",
                       {{"anisotropyStrength", 0.5}, {"anisotropyRotation", 1}});
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(pbr_of(s).anisotropy, 0.5);
         EXPECT_EQ(pbr_of(s).anisotropy_rotation, 1.0);
         EXPECT_THAT(only_mesh(s).tangents, SizeIs(4));
       }},
      {"SpecularGlossiness",
       [](GltfModel& m) {
         set_extension(m, "KHR_materials_pbrSpecularGlossiness",
                       {{"diffuseFactor", {0.5, 0.25, 0, 1}},
                        {"glossinessFactor", 0.75},
                        {"specularFactor", {0.04, 0.04, 0.04}}});
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(pbr_of(s).base_colour, (Vec3{0.5, 0.25, 0}));
         EXPECT_EQ(pbr_of(s).metallic, 0.0);
         EXPECT_EQ(pbr_of(s).roughness, 0.25);
         EXPECT_NEAR(pbr_of(s).ior, 1.5, 1e-9);
       }},
      {"UnknownExtensionsAreNotedOnce",
       [](GltfModel& m) {
         m.json["extensionsUsed"] = {"EXT_one", "VENDOR_two"};
       },
       [](const SceneDescription& s) {
         expect_quad(s);
         EXPECT_THAT(s.notes, ElementsAre("extensions ignored: EXT_one, VENDOR_two"));
       }},
  };
}

}  // namespace lenticule::render
