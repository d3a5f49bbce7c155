// SPDX-License-Identifier: Apache-2.0
// Imports materials and textures from assimp. docs/render/scenes.md has a table of the conversions.
#include <assimp/GltfMaterial.h>
#include <assimp/ObjMaterial.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "base/error.h"
#include "frames/image_io.h"
#include "render/loaders/assimp/parts.h"
#include "render/loaders/file_names.h"
#include "render/loaders/limits.h"
#include "render/loaders/textures.h"
#include "render/loaders/viewer_choices.h"

namespace lenticule::render {
namespace {

constexpr double kShiniest = 1e5;
constexpr double kUsualIndex = 1.5;

double luminance(Vec3 c) {
  return 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z;
}

double clamped(double value, double low, double high) {
  return std::isfinite(value) ? std::clamp(value, low, high) : low;
}

/// Properties gives typed access to one material's properties; non-finite values count as absent.
class Properties {
 public:
  explicit Properties(const aiMaterial& material) : material_(material) {}

  [[nodiscard]] std::optional<double> number(const char* key, unsigned type, unsigned index) const {
    float value = 0.0F;
    if (material_.Get(key, type, index, value) != aiReturn_SUCCESS || !std::isfinite(value))
      return std::nullopt;
    return static_cast<double>(value);
  }
  [[nodiscard]] std::optional<Vec3> colour(const char* key, unsigned type, unsigned index) const {
    aiColor4D value;  // accepts three components as well
    if (material_.Get(key, type, index, value) != aiReturn_SUCCESS) return std::nullopt;
    const Vec3 c(Vec3f(value.r, value.g, value.b));
    if (!is_finite(c)) return std::nullopt;
    return Vec3{std::clamp(c.x, 0.0, 1e6), std::clamp(c.y, 0.0, 1e6), std::clamp(c.z, 0.0, 1e6)};
  }
  [[nodiscard]] std::string text(const char* key, unsigned type, unsigned index) const {
    aiString value;
    return material_.Get(key, type, index, value) == aiReturn_SUCCESS ? value.C_Str() : "";
  }
  [[nodiscard]] std::optional<int> integer(const char* key, unsigned type, unsigned index) const {
    int value = 0;
    if (material_.Get(key, type, index, value) != aiReturn_SUCCESS) return std::nullopt;
    return value;
  }

 private:
  const aiMaterial& material_;
};

/// Converts the classic ambient-diffuse-specular model. Files state a specular colour for
/// highlights; in OBJ only illumination models 3 and above mean mirrors.
void set_classic(const Properties& from, Material& to) {
  const double specular = luminance(from.colour(AI_MATKEY_COLOR_SPECULAR).value_or(Vec3{}));
  const int illumination = from.integer(AI_MATKEY_OBJ_ILLUM).value_or(0);
  constexpr double kHighlightOnly = 0.1;
  const bool mirror = illumination >= 3;
  to.specular = clamped(specular, 0.0, 1.0) * (mirror ? 1.0 : kHighlightOnly);
  to.shine = clamped(from.number(AI_MATKEY_SHININESS).value_or(10.0), 1.0, kShiniest);
  const bool refracts = illumination == 6 || illumination == 7;
  if (refracts) to.refraction_index = from.number(AI_MATKEY_REFRACTI).value_or(1.0);
}

double opacity_of(const Properties& from) {
  return clamped(from.number(AI_MATKEY_OPACITY).value_or(1.0), 0.0, 1.0);
}

Material material_of(const aiMaterial& material, const std::optional<MetallicRoughness>& pbr) {
  const Properties from(material);
  Material to;
  to.name = material.GetName().C_Str();
  to.colour = from.colour(AI_MATKEY_BASE_COLOR)
                  .value_or(from.colour(AI_MATKEY_COLOR_DIFFUSE).value_or(Vec3{0.8, 0.8, 0.8}));
  if (pbr)
    set_metallic_roughness(*pbr, to);
  else
    set_classic(from, to);
  set_opacity(opacity_of(from), to);
  to.refraction_index = clamped(to.refraction_index, 0.1, 100.0);
  to.emission = from.colour(AI_MATKEY_COLOR_EMISSIVE).value_or(Vec3{}) *
                clamped(from.number(AI_MATKEY_EMISSIVE_INTENSITY).value_or(1.0), 0.0, 1e6);
  to.two_sided = true;
  return to;
}

// ---- textures

/// MaterialTextures finds the textures of one material.
class MaterialTextures {
 public:
  MaterialTextures(const aiScene& from, const aiMaterial& material,
                   const std::filesystem::path& folder, const std::string& source,
                   Textures& textures)
      : from_(from), material_(material), folder_(folder), source_(source), textures_(textures) {}

  /// Returns the index of the texture of the first type that the material has, or -1.
  int find(std::initializer_list<aiTextureType> types, frames::TextureContent content) {
    for (const aiTextureType type : types) {
      const std::string name = name_of(type);
      if (name.empty()) continue;
      return textures_.add({.name = name,
                            .wrap_u = wrap_of(AI_MATKEY_MAPPINGMODE_U(type, 0)),
                            .wrap_v = wrap_of(AI_MATKEY_MAPPINGMODE_V(type, 0)),
                            .content = content},
                           [&] { return read(name, content); });
    }
    return -1;
  }

  /// Returns one texture made of those of roughness and metalness, which may be separate grey
  /// pictures: roughness in green, metalness in blue.
  int find_metallic_roughness() {
    constexpr auto kData = frames::TextureContent::Data;
    const std::string rough = name_of(aiTextureType_DIFFUSE_ROUGHNESS);
    const std::string metal = name_of(aiTextureType_METALNESS);
    if (rough.empty() && metal.empty()) return -1;
    const auto wrapped = rough.empty() ? aiTextureType_METALNESS : aiTextureType_DIFFUSE_ROUGHNESS;
    return textures_.add({.name = rough + " + " + metal,
                          .wrap_u = wrap_of(AI_MATKEY_MAPPINGMODE_U(wrapped, 0)),
                          .wrap_v = wrap_of(AI_MATKEY_MAPPINGMODE_V(wrapped, 0)),
                          .content = kData},
                         [&] {
                           if (rough == metal) return read(rough, kData);
                           return combined(rough, metal);
                         });
  }

  [[nodiscard]] bool has(aiTextureType type) const { return !name_of(type).empty(); }

 private:
  [[nodiscard]] std::string name_of(aiTextureType type) const {
    aiString name;
    if (material_.GetTextureCount(type) == 0) return "";
    return material_.GetTexture(type, 0, &name) == aiReturn_SUCCESS ? name.C_Str() : "";
  }

  [[nodiscard]] TextureWrap wrap_of(const char* key, unsigned type, unsigned index) const {
    int value = aiTextureMapMode_Wrap;
    material_.Get(key, type, index, value);
    return value == aiTextureMapMode_Wrap     ? TextureWrap::Repeat
           : value == aiTextureMapMode_Mirror ? TextureWrap::Mirror
                                              : TextureWrap::Clamp;
  }

  frames::TextureImage read(const std::string& name, frames::TextureContent content) {
    if (const aiTexture* embedded = from_.GetEmbeddedTexture(name.c_str()))
      return read_embedded(*embedded, name, content);
    return frames::read_texture(named_file(folder_, name), content);
  }

  frames::TextureImage read_embedded(const aiTexture& embedded, const std::string& name,
                                     frames::TextureContent content) {
    const std::string label = fmt::format("{}: embedded texture {}", source_, name);
    if (embedded.pcData == nullptr) throw Error(ErrorKind::Input, label + ": empty");
    if (embedded.mHeight == 0)
      return frames::read_texture(
          std::span(reinterpret_cast<const uint8_t*>(embedded.pcData), embedded.mWidth), label,
          content);
    const size_t texels = static_cast<size_t>(embedded.mWidth) * embedded.mHeight;
    if (texels > kMaxTextureBytes / 4) throw Error(ErrorKind::Input, label + ": too large");
    frames::TextureImage image{
        static_cast<int>(embedded.mWidth), static_cast<int>(embedded.mHeight), {}, {}};
    image.codes.reserve(texels * 4);
    for (const aiTexel& t : std::span(embedded.pcData, texels))
      image.codes.insert(image.codes.end(), {t.r, t.g, t.b, t.a});
    return image;
  }

  /// Returns the larger size of both pictures; a missing one counts as white.
  frames::TextureImage combined(const std::string& rough, const std::string& metal) {
    const auto picture = [&](const std::string& name) {
      return name.empty() ? frames::FloatImage{1, 1, {1, 1, 1, 1}}
                          : frames::floats_of(read(name, frames::TextureContent::Data),
                                              frames::TextureContent::Data);
    };
    const frames::FloatImage roughness = picture(rough);
    const frames::FloatImage metalness = picture(metal);
    frames::TextureImage both{std::max(roughness.width, metalness.width),
                              std::max(roughness.height, metalness.height),
                              {},
                              {}};
    const auto grey = [&](const frames::FloatImage& image, int x, int y) {
      const auto column = static_cast<int64_t>(x) * image.width / both.width;
      const auto row = static_cast<int64_t>(y) * image.height / both.height;
      return image.rgba[static_cast<size_t>(row * image.width + column) * 4];
    };
    both.rgba.reserve(static_cast<size_t>(both.width) * static_cast<size_t>(both.height) * 4);
    for (int y = 0; y < both.height; ++y)
      for (int x = 0; x < both.width; ++x)
        both.rgba.insert(both.rgba.end(),
                         {1.0F, grey(roughness, x, y), grey(metalness, x, y), 1.0F});
    return both;
  }

  const aiScene& from_;
  const aiMaterial& material_;
  const std::filesystem::path& folder_;
  const std::string& source_;
  Textures& textures_;
};

// ---- metallic-roughness materials

/// Returns the factors if the file states any of them, or textures of them.
std::optional<MetallicRoughness> metallic_roughness_of(const Properties& from,
                                                       const MaterialTextures& textures) {
  const auto metallic = from.number(AI_MATKEY_METALLIC_FACTOR);
  const auto roughness = from.number(AI_MATKEY_ROUGHNESS_FACTOR);
  const bool metal_texture = textures.has(aiTextureType_METALNESS);
  const bool rough_texture = textures.has(aiTextureType_DIFFUSE_ROUGHNESS);
  if (!metallic && !roughness && !metal_texture && !rough_texture) return std::nullopt;
  return MetallicRoughness{
      .metallic = clamped(metallic.value_or(metal_texture ? 1.0 : 0.0), 0.0, 1.0),
      .roughness = clamped(roughness.value_or(1.0), 0.0, 1.0),
      .transmission = clamped(from.number(AI_MATKEY_TRANSMISSION_FACTOR).value_or(0.0), 0.0, 1.0),
      .ior = from.number(AI_MATKEY_REFRACTI).value_or(kUsualIndex)};
}

std::shared_ptr<const PbrMaterial> pbr_of(const Properties& from, const MetallicRoughness& factors,
                                          const Material& whitted, MaterialTextures& textures) {
  constexpr auto kData = frames::TextureContent::Data;
  PbrMaterial to;
  to.base_colour = whitted.colour;
  to.alpha = opacity_of(from);
  if (to.alpha < 1.0) to.alpha_mode = PbrMaterial::AlphaMode::Blend;
  to.base_colour_texture.texture = whitted.texture;
  to.metallic = factors.metallic;
  to.roughness = factors.roughness;
  to.metallic_roughness_texture.texture = textures.find_metallic_roughness();
  to.normal_texture.texture = textures.find({aiTextureType_NORMALS}, kData);
  to.emission = whitted.emission;
  to.emission_texture.texture = textures.find(
      {aiTextureType_EMISSION_COLOR, aiTextureType_EMISSIVE}, frames::TextureContent::Colour);
  // A file with a texture and no colour, or black, means the texture.
  if (to.emission_texture.texture >= 0 && to.emission == Vec3{}) to.emission = {1, 1, 1};
  to.double_sided = true;
  to.transmission = factors.transmission;
  to.ior = clamped(factors.ior, 1.0, 100.0);
  to.clearcoat = clamped(from.number(AI_MATKEY_CLEARCOAT_FACTOR).value_or(0.0), 0.0, 1.0);
  to.clearcoat_roughness =
      clamped(from.number(AI_MATKEY_CLEARCOAT_ROUGHNESS_FACTOR).value_or(0.0), 0.0, 1.0);
  to.sheen_colour = from.colour(AI_MATKEY_SHEEN_COLOR_FACTOR).value_or(Vec3{});
  return std::make_shared<const PbrMaterial>(to);
}

}  // namespace

void import_materials(const aiScene& from, const std::filesystem::path& folder,
                      SceneDescription& scene) {
  if (from.mNumMaterials > kMaxMaterials)
    throw Error(ErrorKind::Input,
                fmt::format("{}: more than {} materials", scene.source, kMaxMaterials));
  Textures all(scene);
  for (const aiMaterial* material : std::span(from.mMaterials, from.mNumMaterials)) {
    const Properties properties(*material);
    MaterialTextures textures(from, *material, folder, scene.source, all);
    const auto factors = metallic_roughness_of(properties, textures);
    Material to = material_of(*material, factors);
    to.texture = textures.find({aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE},
                               frames::TextureContent::Colour);
    if (factors) to.pbr = pbr_of(properties, *factors, to, textures);
    scene.materials.push_back(std::move(to));
  }
}

}  // namespace lenticule::render
