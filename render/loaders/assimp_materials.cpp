// SPDX-License-Identifier: Apache-2.0
// Imports materials and textures from assimp. docs/scenes.md has a table of the conversions.
#include <assimp/GltfMaterial.h>
#include <assimp/ObjMaterial.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <span>

#include "base/error.h"
#include "frames/image_io.h"
#include "frames/srgb.h"
#include "render/loaders/assimp_parts.h"
#include "render/loaders/limits.h"

namespace lenticule::render {
namespace {

constexpr double kShiniest = 1e5;

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

/// Converts metallic-roughness. Light that a rough surface scatters widely is moved from the mirror
/// to the diffuse part, since the shading has no blurred reflections.
void set_metallic_roughness(const Properties& from, double metallic, double roughness,
                            Material& to) {
  const double smooth = 1.0 - roughness;
  const double transmission =
      clamped(from.number(AI_MATKEY_TRANSMISSION_FACTOR).value_or(0.0), 0.0, 1.0);
  constexpr double kDielectricReflectance = 0.04;
  const double mirror = metallic * smooth + (1.0 - metallic) * kDielectricReflectance * smooth;
  to.transmittance = (1.0 - metallic) * transmission;
  to.specular = mirror;
  to.diffuse = std::max(0.0, 1.0 - mirror - to.transmittance);
  // Phong exponent equivalent to a Beckmann lobe of this roughness.
  const double alpha = std::max(roughness * roughness, 1e-3);
  to.shine = std::clamp(2.0 / (alpha * alpha) - 2.0, 1.0, kShiniest);
  to.tinted_specular = metallic > 0.5;
  constexpr double kUsualIndex = 1.5;
  if (to.transmittance > 0.0)
    to.refraction_index = from.number(AI_MATKEY_REFRACTI).value_or(kUsualIndex);
}

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

/// Converts opacity below 1 to transmittance without refraction.
void set_opacity(const Properties& from, Material& to) {
  if (from.text(AI_MATKEY_GLTF_ALPHAMODE) == "OPAQUE") return;
  const double opacity = clamped(from.number(AI_MATKEY_OPACITY).value_or(1.0), 0.0, 1.0);
  to.transmittance = std::max(to.transmittance, 1.0 - opacity);
  to.diffuse *= opacity;
}

Material material_of(const aiMaterial& material) {
  const Properties from(material);
  Material to;
  to.name = material.GetName().C_Str();
  to.colour = from.colour(AI_MATKEY_BASE_COLOR)
                  .value_or(from.colour(AI_MATKEY_COLOR_DIFFUSE).value_or(Vec3{0.8, 0.8, 0.8}));
  const auto metallic = from.number(AI_MATKEY_METALLIC_FACTOR);
  const auto roughness = from.number(AI_MATKEY_ROUGHNESS_FACTOR);
  if (metallic || roughness)
    set_metallic_roughness(from, clamped(metallic.value_or(0.0), 0.0, 1.0),
                           clamped(roughness.value_or(1.0), 0.0, 1.0), to);
  else
    set_classic(from, to);
  set_opacity(from, to);
  to.refraction_index = clamped(to.refraction_index, 0.1, 100.0);
  to.emission = from.colour(AI_MATKEY_COLOR_EMISSIVE).value_or(Vec3{}) *
                clamped(from.number(AI_MATKEY_EMISSIVE_INTENSITY).value_or(1.0), 0.0, 1e6);
  to.two_sided = true;
  return to;
}

// ---- textures

std::shared_ptr<Texture> texture_of(frames::FloatImage image) {
  auto texture = std::make_shared<Texture>();
  texture->width = image.width;
  texture->height = image.height;
  texture->rgba = std::move(image.rgba);
  return texture;
}

/// Decodes "%20" and similar, as used by URIs in glTF files.
std::string percent_decoded(const std::string& text) {
  const auto digit = [](char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
  };
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const bool escape =
        text[i] == '%' && i + 2 < text.size() && digit(text[i + 1]) >= 0 && digit(text[i + 2]) >= 0;
    out += escape ? static_cast<char>(digit(text[i + 1]) * 16 + digit(text[i + 2])) : text[i];
    if (escape) i += 2;
  }
  return out;
}

class TextureImport {
 public:
  TextureImport(const aiScene& from, std::filesystem::path folder, SceneDescription& scene)
      : from_(from), folder_(std::move(folder)), scene_(scene) {}

  /// Returns the index of the base-colour texture, or -1 if the material keeps its plain colour.
  int base_colour(const aiMaterial& material) {
    for (const aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE}) {
      aiString name;
      if (material.GetTextureCount(type) == 0) continue;
      if (material.GetTexture(type, 0, &name) != aiReturn_SUCCESS || name.length == 0) continue;
      return index_of(name.C_Str(), mode(material, AI_MATKEY_MAPPINGMODE_U(type, 0)),
                      mode(material, AI_MATKEY_MAPPINGMODE_V(type, 0)));
    }
    return -1;
  }

 private:
  /// Returns true if a texture repeats; mirrored repeats count as plain ones.
  static bool mode(const aiMaterial& material, const char* key, unsigned type, unsigned index) {
    int value = aiTextureMapMode_Wrap;
    material.Get(key, type, index, value);
    return value == aiTextureMapMode_Wrap || value == aiTextureMapMode_Mirror;
  }

  int index_of(const std::string& name, bool repeat_u, bool repeat_v) {
    const auto [place, added] = known_.try_emplace({name, repeat_u, repeat_v}, -1);
    if (!added) return place->second;
    try {
      const std::shared_ptr<Texture> texture = read(name);
      texture->repeat_u = repeat_u;
      texture->repeat_v = repeat_v;
      texture->name = name;
      texels_ += texture->rgba.size() / 4;
      if (texels_ > kMaxTexels)
        throw Error(ErrorKind::Input, fmt::format("textures of more than {} texels", kMaxTexels));
      place->second = static_cast<int>(scene_.textures.size());
      scene_.textures.push_back(texture);
    } catch (const Error& error) {
      // A missing picture should not prevent displaying the scene.
      scene_.notes.push_back(fmt::format("texture left out: {}", error.what()));
    }
    return place->second;
  }

  std::shared_ptr<Texture> read(const std::string& name) {
    if (const aiTexture* embedded = from_.GetEmbeddedTexture(name.c_str()))
      return read_embedded(*embedded, name);
    std::string path = name;
    std::replace(path.begin(), path.end(), '\\', '/');
    std::error_code error;
    if (!std::filesystem::exists(folder_ / path, error)) path = percent_decoded(path);
    return texture_of(frames::read_texture(folder_ / path));
  }

  std::shared_ptr<Texture> read_embedded(const aiTexture& embedded, const std::string& name) {
    const std::string label = fmt::format("{}: embedded texture {}", scene_.source, name);
    if (embedded.pcData == nullptr) throw Error(ErrorKind::Input, label + ": empty");
    if (embedded.mHeight == 0)
      return texture_of(frames::read_texture(
          std::span(reinterpret_cast<const uint8_t*>(embedded.pcData), embedded.mWidth), label));
    const size_t texels = static_cast<size_t>(embedded.mWidth) * embedded.mHeight;
    if (texels > kMaxTexels) throw Error(ErrorKind::Input, label + ": too large");
    frames::FloatImage image{
        static_cast<int>(embedded.mWidth), static_cast<int>(embedded.mHeight), {}};
    const auto& linear = frames::linear_of_codes();
    image.rgba.reserve(texels * 4);
    for (const aiTexel& t : std::span(embedded.pcData, texels)) {
      for (const uint8_t code : {t.r, t.g, t.b})
        image.rgba.push_back(static_cast<float>(linear[code]));
      image.rgba.push_back(static_cast<float>(t.a) / 255.0F);
    }
    return texture_of(std::move(image));
  }

  struct Key {
    std::string name;
    bool repeat_u;
    bool repeat_v;
    friend auto operator<=>(const Key&, const Key&) = default;
  };

  const aiScene& from_;
  std::filesystem::path folder_;
  SceneDescription& scene_;
  std::map<Key, int> known_;
  size_t texels_ = 0;
};

}  // namespace

void import_materials(const aiScene& from, const std::filesystem::path& folder,
                      SceneDescription& scene) {
  if (from.mNumMaterials > kMaxMaterials)
    throw Error(ErrorKind::Input,
                fmt::format("{}: more than {} materials", scene.source, kMaxMaterials));
  TextureImport textures(from, folder, scene);
  for (const aiMaterial* material : std::span(from.mMaterials, from.mNumMaterials)) {
    scene.materials.push_back(material_of(*material));
    scene.materials.back().texture = textures.base_colour(*material);
  }
}

}  // namespace lenticule::render
