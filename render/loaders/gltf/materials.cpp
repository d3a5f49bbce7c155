// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/gltf/materials.h"

#include <cmath>
#include <string_view>

#include "base/error_kinds.h"
#include "render/loaders/formats.h"

namespace lenticule::render::gltf {
namespace {

using frames::TextureContent;
using enum frames::TextureContent;

constexpr double kBrightest = 1e6;
/// Limit of the scale of normal maps.
constexpr double kSteepest = 1e6;

Vec3 clamped(Vec3 c, double high) {
  return {std::clamp(c.x, 0.0, high), std::clamp(c.y, 0.0, high), std::clamp(c.z, 0.0, high)};
}

double share(const JsonAt& from, const char* key, double otherwise) {
  return from.number_within(key, otherwise, 0.0, 1.0);
}

TextureWrap wrap_of(const JsonAt& sampler, const char* key) {
  constexpr uint64_t kClamp = 33071;
  constexpr uint64_t kMirror = 33648;
  constexpr uint64_t kRepeat = 10497;
  switch (sampler.whole(key, kRepeat)) {
    case kClamp:
      return TextureWrap::Clamp;
    case kMirror:
      return TextureWrap::Mirror;
    case kRepeat:
      return TextureWrap::Repeat;
    default:
      sampler.at(key).fail("unknown wrapping mode; expected 33071, 33648 or 10497");
  }
}

/// Returns translation * rotation * scale of KHR_texture_transform. The rotation is counter-
/// clockwise as seen, with v downward.
std::array<double, 6> uv_map_of(const JsonAt& transform) {
  const auto offset = transform.numbers("offset", 2).value_or(std::vector<double>{0, 0});
  const auto scale = transform.numbers("scale", 2).value_or(std::vector<double>{1, 1});
  const double angle = transform.number("rotation", 0.0);
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  return {c * scale[0], s * scale[1], offset[0], -s * scale[0], c * scale[1], offset[1]};
}

frames::TextureImage decode_picture(Bytes bytes, const std::string& label, TextureContent content) {
  using namespace std::string_view_literals;
  constexpr std::string_view kKtx2 = "\xABKTX 20\xBB"sv;
  if (bytes.size() >= kKtx2.size() &&
      std::equal(kKtx2.begin(), kKtx2.end(), bytes.begin(),
                 [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; }))
    throw input_error(
        "{}: KTX2 textures are not read; convert the model with 'gltf-transform ktxdecompress'",
        label);
  return frames::read_texture(bytes, label, content, frames::TexelPlace::Anywhere);
}

PbrMaterial::AlphaMode alpha_mode_of(const JsonAt& from) {
  const std::string mode = from.text("alphaMode", "OPAQUE");
  if (mode == "OPAQUE") return PbrMaterial::AlphaMode::Opaque;
  if (mode == "MASK") return PbrMaterial::AlphaMode::Mask;
  if (mode == "BLEND") return PbrMaterial::AlphaMode::Blend;
  from.at("alphaMode").fail("expected OPAQUE, MASK or BLEND");
}

}  // namespace

Materials::Materials(Document& document, const std::vector<bool>& used, SceneDescription& scene,
                     Notes& notes, Textures::Mode mode)
    : document_(document), used_(used), scene_(scene), notes_(notes), textures_(scene, mode) {}

/// Reads the materials twice: first to learn which pictures they use, so that those are decoded
/// side by side.
Materials::Materials(Document& document, const std::vector<bool>& used, SceneDescription& scene,
                     Notes& notes)
    : Materials(document, used, scene, notes, Textures::Mode::Load) {
  SceneDescription unused_scene;
  Notes unused_notes;
  Materials first(document, used, unused_scene, unused_notes, Textures::Mode::List);
  first.add_all();
  textures_.decode_all(first.textures_);
  add_all();
}

void Materials::add_all() {
  const std::vector<JsonAt>& materials = document_.list("materials");
  for (const JsonAt& name : document_.list("extensionsRequired"))
    if (name.text() == "KHR_materials_pbrSpecularGlossiness") requires_specular_glossiness_ = true;
  if (materials.size() > kMaxMaterials)
    document_.root().at("materials").fail(fmt::format("more than {} materials", kMaxMaterials));
  for (const JsonAt& material : materials) add(material);
}

int Materials::index(std::optional<size_t> index) {
  if (index) return static_cast<int>(*index);
  if (!default_) {
    default_ = static_cast<int>(scene_.materials.size());
    add(std::nullopt);
  }
  return *default_;
}

int Materials::magnified(int material, double scale) {
  const Material& original = scene_.materials[static_cast<size_t>(material)];
  constexpr double kSame = 1e-6;
  if (original.pbr->thickness == 0.0 || std::abs(scale - 1.0) < kSame) return material;
  const auto [known, added] =
      magnified_.try_emplace({material, scale}, static_cast<int>(scene_.materials.size()));
  if (!added) return known->second;
  if (scene_.materials.size() >= kMaxMaterials)
    throw input_error("{}: more than {} materials", document_.source(), kMaxMaterials);
  Material copy = original;
  PbrMaterial thicker = *copy.pbr;
  thicker.thickness *= scale;
  copy.pbr = std::make_shared<const PbrMaterial>(thicker);
  scene_.materials.push_back(copy);
  inputs_.push_back(MaterialInput(inputs_[static_cast<size_t>(material)]));
  return known->second;
}

void Materials::add(const std::optional<JsonAt>& material) {
  Material to;
  PbrMaterial pbr;
  MaterialInput& input = inputs_.emplace_back();
  if (material) to.name = material->text("name", "");
  if (material && used_[scene_.materials.size()]) {
    read_core(*material, pbr);
    read_layers(*material, pbr);
    read_transmission(*material, pbr);
    if (!input.tangent_uvs && pbr.anisotropy != 0.0) input.tangent_uvs = 0;
  }
  if (input.uv_sets.empty()) input.uv_sets.push_back(0);
  to.pbr = std::make_shared<const PbrMaterial>(pbr);
  scene_.materials.push_back(to);
}

// ---- textures

int Materials::picture(const JsonAt& texture, TextureContent content) {
  const std::vector<JsonAt>& images = document_.list("images");
  auto index = texture.find_index("source", images.size(), "images");
  if (const auto webp = texture.extension("EXT_texture_webp"))
    index = webp->at("source").index(images.size(), "images");
  if (!index) {
    notes_.count(texture.extension("KHR_texture_basisu")
                     ? "textures left out: KTX2 is not read; convert the model with "
                       "'gltf-transform ktxdecompress'"
                     : "textures without a picture left out");
    return -1;
  }
  const JsonAt& image = images[*index];
  TextureSource source{.name = image.path(), .content = content};
  const std::vector<JsonAt>& samplers = document_.list("samplers");
  if (const auto sampler = texture.find_index("sampler", samplers.size(), "samplers")) {
    source.wrap_u = wrap_of(samplers[*sampler], "wrapS");
    source.wrap_v = wrap_of(samplers[*sampler], "wrapT");
  }
  std::string label = fmt::format("{}: {}", document_.source(), image.path());
  const std::vector<JsonAt>& views = document_.list("bufferViews");
  if (const auto view = image.find_index("bufferView", views.size(), "buffer views")) {
    const Bytes bytes = document_.view(*view).bytes;
    return textures_.add(source, [=] { return decode_picture(bytes, label, content); });
  }
  const JsonAt uri = image.at("uri");
  if (!is_data_uri(uri.text())) {
    source.name = uri.text();
    label += ", " + source.name;
  }
  return textures_.add(source, [&document = document_, uri, label, content] {
    return decode_picture(document.read_uri(uri), label, content);
  });
}

TextureUse Materials::texture(const JsonAt& owner, const char* key, TextureContent content) {
  const auto info = owner.find(key);
  if (!info) return {};
  const std::vector<JsonAt>& textures = document_.list("textures");
  TextureUse use;
  use.texture = picture(textures[info->at("index").index(textures.size(), "textures")], content);
  uint64_t set = info->whole("texCoord", 0);
  if (const auto transform = info->extension("KHR_texture_transform")) {
    set = transform->whole("texCoord", set);
    use.uv_map = uv_map_of(*transform);
  }
  if (use.texture < 0) return {};
  constexpr size_t kMostSets = 2;
  std::vector<uint64_t>& sets = inputs_.back().uv_sets;
  const auto slot = std::ranges::find(sets, set) - sets.begin();
  if (static_cast<size_t>(slot) == kMostSets) {
    notes_.count("textures left out: their material uses more than two sets of coordinates");
    return {};
  }
  if (static_cast<size_t>(slot) == sets.size()) sets.push_back(set);
  use.uv_set = static_cast<int>(slot);
  return use;
}

// ---- properties

void Materials::read_core(const JsonAt& from, PbrMaterial& to) {
  // A file that does not require the older model states its material in both, and ours is exact.
  const auto pbr = from.find("pbrMetallicRoughness");
  const auto old = from.extension("KHR_materials_pbrSpecularGlossiness");
  if (old && (!pbr || requires_specular_glossiness_)) {
    read_specular_glossiness(*old, to);
  } else if (pbr) {
    if (const auto colour = pbr->numbers("baseColorFactor", 4)) {
      to.base_colour = clamped({(*colour)[0], (*colour)[1], (*colour)[2]}, 1.0);
      to.alpha = std::clamp((*colour)[3], 0.0, 1.0);
    }
    to.base_colour_texture = texture(*pbr, "baseColorTexture", Colour);
    to.metallic = share(*pbr, "metallicFactor", 1.0);
    to.roughness = share(*pbr, "roughnessFactor", 1.0);
    to.metallic_roughness_texture = texture(*pbr, "metallicRoughnessTexture", Data);
  }
  to.normal_texture = texture(from, "normalTexture", Data);
  if (to.normal_texture.texture >= 0) {
    inputs_.back().tangent_uvs = static_cast<size_t>(to.normal_texture.uv_set);
    to.normal_scale = from.at("normalTexture").number_within("scale", 1.0, -kSteepest, kSteepest);
  }
  to.occlusion_texture = texture(from, "occlusionTexture", Data);
  if (to.occlusion_texture.texture >= 0)
    to.occlusion_strength = share(from.at("occlusionTexture"), "strength", 1.0);
  double strength = 1.0;
  if (const auto emission = from.extension("KHR_materials_emissive_strength"))
    strength = emission->number_within("emissiveStrength", 1.0, 0.0, kBrightest);
  to.emission = clamped(from.vector("emissiveFactor", {0, 0, 0}), 1.0) * strength;
  to.emission_texture = texture(from, "emissiveTexture", Colour);
  to.alpha_mode = alpha_mode_of(from);
  to.alpha_cutoff = from.number_within("alphaCutoff", 0.5, 0.0, kBrightest);
  to.double_sided = from.flag("doubleSided", false);
  to.unlit = from.extension("KHR_materials_unlit").has_value();
  if (const auto ior = from.extension("KHR_materials_ior"))
    to.ior = ior->number_within("ior", 1.5, 0.0, 100.0);
}

/// Converts the material model that glTF had before metallic-roughness: the specular colour becomes
/// an index of refraction and a tint.
void Materials::read_specular_glossiness(const JsonAt& from, PbrMaterial& to) {
  if (const auto colour = from.numbers("diffuseFactor", 4)) {
    to.base_colour = clamped({(*colour)[0], (*colour)[1], (*colour)[2]}, 1.0);
    to.alpha = std::clamp((*colour)[3], 0.0, 1.0);
  }
  to.base_colour_texture = texture(from, "diffuseTexture", Colour);
  to.metallic = 0.0;
  to.roughness = 1.0 - share(from, "glossinessFactor", 1.0);
  const Vec3 specular = clamped(from.vector("specularFactor", {1, 1, 1}), 1.0);
  const double strongest = std::max({specular.x, specular.y, specular.z});
  constexpr double kMostReflected = 0.98;
  const double root = std::sqrt(std::min(strongest, kMostReflected));
  to.ior = (1.0 + root) / (1.0 - root);
  to.specular_colour = strongest > 0.0 ? specular / strongest : Vec3{1, 1, 1};
  if (from.find("specularGlossinessTexture"))
    notes_.count(
        "specular-glossiness textures ignored: convert the model with "
        "'gltf-transform metalrough'");
}

void Materials::read_layers(const JsonAt& from, PbrMaterial& to) {
  if (const auto specular = from.extension("KHR_materials_specular")) {
    to.specular = share(*specular, "specularFactor", 1.0);
    to.specular_texture = texture(*specular, "specularTexture", Data);
    to.specular_colour = clamped(specular->vector("specularColorFactor", {1, 1, 1}), kBrightest);
    to.specular_colour_texture = texture(*specular, "specularColorTexture", Colour);
  }
  if (const auto coat = from.extension("KHR_materials_clearcoat")) {
    to.clearcoat = share(*coat, "clearcoatFactor", 0.0);
    to.clearcoat_texture = texture(*coat, "clearcoatTexture", Data);
    to.clearcoat_roughness = share(*coat, "clearcoatRoughnessFactor", 0.0);
    to.clearcoat_roughness_texture = texture(*coat, "clearcoatRoughnessTexture", Data);
    to.clearcoat_normal_texture = texture(*coat, "clearcoatNormalTexture", Data);
    if (to.clearcoat_normal_texture.texture >= 0 && !inputs_.back().tangent_uvs)
      inputs_.back().tangent_uvs = static_cast<size_t>(to.clearcoat_normal_texture.uv_set);
  }
  if (const auto sheen = from.extension("KHR_materials_sheen")) {
    to.sheen_colour = clamped(sheen->vector("sheenColorFactor", {0, 0, 0}), 1.0);
    to.sheen_colour_texture = texture(*sheen, "sheenColorTexture", Colour);
    to.sheen_roughness = share(*sheen, "sheenRoughnessFactor", 0.0);
    to.sheen_roughness_texture = texture(*sheen, "sheenRoughnessTexture", Data);
  }
  if (const auto film = from.extension("KHR_materials_iridescence")) {
    to.iridescence = share(*film, "iridescenceFactor", 0.0);
    to.iridescence_texture = texture(*film, "iridescenceTexture", Data);
    to.iridescence_ior = film->number_within("iridescenceIor", 1.3, 1.0, 100.0);
    to.iridescence_thickness_min =
        film->number_within("iridescenceThicknessMinimum", 100.0, 0.0, kBrightest);
    to.iridescence_thickness_max =
        film->number_within("iridescenceThicknessMaximum", 400.0, 0.0, kBrightest);
    to.iridescence_thickness_texture = texture(*film, "iridescenceThicknessTexture", Data);
  }
  if (const auto brushed = from.extension("KHR_materials_anisotropy")) {
    to.anisotropy = share(*brushed, "anisotropyStrength", 0.0);
    to.anisotropy_rotation = brushed->number("anisotropyRotation", 0.0);
    to.anisotropy_texture = texture(*brushed, "anisotropyTexture", Data);
    if (to.anisotropy_texture.texture >= 0 && !inputs_.back().tangent_uvs)
      inputs_.back().tangent_uvs = static_cast<size_t>(to.anisotropy_texture.uv_set);
  }
}

void Materials::read_transmission(const JsonAt& from, PbrMaterial& to) {
  if (const auto glass = from.extension("KHR_materials_transmission")) {
    to.transmission = share(*glass, "transmissionFactor", 0.0);
    to.transmission_texture = texture(*glass, "transmissionTexture", Data);
  }
  if (const auto volume = from.extension("KHR_materials_volume")) {
    to.thickness = volume->number_within("thicknessFactor", 0.0, 0.0, kMaxCoordinate);
    to.thickness_texture = texture(*volume, "thicknessTexture", Data);
    to.attenuation_distance = volume->number("attenuationDistance", to.attenuation_distance);
    if (!(to.attenuation_distance > 0.0))
      volume->at("attenuationDistance").fail("not a positive number");
    to.attenuation_colour = clamped(volume->vector("attenuationColor", {1, 1, 1}), 1.0);
  }
}

}  // namespace lenticule::render::gltf
