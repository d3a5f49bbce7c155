// SPDX-License-Identifier: Apache-2.0
#include "lab/judges/gltf_writer.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <span>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "frames/picture_codec.h"
#include "frames/srgb.h"
#include "render/scene/texture.h"

namespace lenticule::lab {
namespace {

using nlohmann::json;

// Constants of the glTF format.
constexpr int kFloat = 5126;
constexpr int kUnsignedInt = 5125;
constexpr int kVertices = 34962;
constexpr int kIndices = 34963;
constexpr int kLinear = 9729;
constexpr int kRepeat = 10497;
constexpr int kMirror = 33648;
constexpr int kClamp = 33071;

std::string base64(std::span<const uint8_t> bytes) {
  constexpr size_t kPart = size_t{3} << 28;  // the length of its output must fit into an int
  std::string text((bytes.size() + 2) / 3 * 4, '\0');
  auto* out = reinterpret_cast<unsigned char*>(text.data());
  while (!bytes.empty()) {
    const auto part = bytes.first(std::min(bytes.size(), kPart));
    out += EVP_EncodeBlock(out, part.data(), static_cast<int>(part.size()));
    bytes = bytes.subspan(part.size());
  }
  return text;
}

uint8_t code_of(const render::SceneDescription& scene, double value) {
  if (scene.colour_managed) return frames::code_from_linear(value);
  return static_cast<uint8_t>(std::lround(255.0 * std::clamp(value, 0.0, 1.0)));
}

std::vector<uint8_t> png_of(const render::SceneDescription& scene, const render::Texture& texture) {
  frames::WovenFrame picture({.width = texture.width, .height = texture.height});
  for (size_t i = 0; i < picture.bytes().size(); ++i)
    picture.bytes()[i] =
        code_of(scene, render::texel_light(texture, i / 3, static_cast<int>(i % 3)));
  return frames::png_codec().encode(picture.view(), frames::ImageFormat::Png, texture.name);
}

void check(const render::SceneDescription& scene) {
  if (!scene.spheres.empty() || !scene.cones.empty())
    throw Error(ErrorKind::Usage,
                fmt::format("{}: has {} spheres and {} cones, but glTF has only triangles",
                            scene.source, scene.spheres.size(), scene.cones.size()),
                "write the scene as .nff");
  if (!scene.nodes.empty())
    throw Error(ErrorKind::Usage,
                fmt::format("{}: a scene for glTF cannot have nodes", scene.source));
  for (const render::Light& light : scene.lights)
    if (light.kind != render::Light::Kind::Point)
      throw Error(ErrorKind::Usage,
                  fmt::format("{}: only point lights are written as glTF", scene.source));
}

class GltfWriter {
 public:
  explicit GltfWriter(const render::SceneDescription& scene) : scene_(scene) {}

  GltfText write() {
    start();
    for (const auto& texture : scene_.textures) write_texture(*texture);
    for (const render::Material& material : scene_.materials) write_material(material);
    for (const render::TriangleMesh& mesh : scene_.meshes)
      if (!mesh.triangles.empty()) write_mesh(mesh);
    for (const render::Light& light : scene_.lights) write_light(light);
    if (!scene_.cameras.empty()) write_camera(scene_.cameras.front());
    finish();
    return std::move(out_);
  }

 private:
  /// Starts the document. All nodes are children of one node that rotates scenes whose up axis is
  /// z; glTF's is y.
  void start() {
    root_ = {{"asset", {{"version", "2.0"}, {"generator", "lenticule"}}},
             {"scene", 0},
             {"scenes", json::array({{{"nodes", {0}}}})}};
    json top = {{"name", scene_.source}};
    const Vec3 up = scene_.cameras.empty() ? Vec3{0, 1, 0} : scene_.cameras.front().up;
    if (std::abs(up.z) > std::abs(up.y))
      top["rotation"] = {-std::numbers::sqrt2 / 2.0, 0, 0, std::numbers::sqrt2 / 2.0};
    root_["nodes"].push_back(top);
  }

  void add_node(const json& node) {
    root_["nodes"][0]["children"].push_back(root_["nodes"].size());
    root_["nodes"].push_back(node);
  }

  void use_extension(const char* name) {
    auto& used = root_["extensionsUsed"];
    if (std::find(used.begin(), used.end(), name) == used.end()) used.push_back(name);
  }

  void write_texture(const render::Texture& texture) {
    const size_t n = root_.contains("images") ? root_["images"].size() : 0;
    root_["images"].push_back(
        {{"name", texture.name},
         {"uri", "data:image/png;base64," + base64(png_of(scene_, texture))}});
    const auto wrap = [](bool repeat, bool mirror) {
      return mirror ? kMirror : repeat ? kRepeat : kClamp;
    };
    root_["samplers"].push_back({{"magFilter", kLinear},
                                 {"minFilter", kLinear},
                                 {"wrapS", wrap(texture.repeat_u, texture.mirror_u)},
                                 {"wrapT", wrap(texture.repeat_v, texture.mirror_v)}});
    root_["textures"].push_back({{"source", n}, {"sampler", n}});
  }

  [[nodiscard]] json linear(Vec3 colour) const {
    const auto light = [this](double value) {
      return scene_.colour_managed ? value : frames::linear_from_srgb(std::clamp(value, 0.0, 1.0));
    };
    return {light(colour.x), light(colour.y), light(colour.z), 1.0};
  }

  /// Writes a material, inverting the reader's rules in docs/render/models.md as far as possible: a
  /// mirror becomes a smooth metal, other materials become matt with the highlight's width.
  void write_material(const render::Material& m) {
    constexpr double kSpecularOfMirrors = 0.3;
    const bool mirror = m.specular >= kSpecularOfMirrors;
    const double rough = std::pow(2.0 / (m.shine + 2.0), 0.25);
    json surface = {{"baseColorFactor", linear(m.colour)},
                    {"metallicFactor", mirror ? std::min(1.0, m.specular) : 0.0},
                    {"roughnessFactor", mirror ? 0.0 : std::clamp(rough, 0.0, 1.0)}};
    if (m.texture >= 0) surface["baseColorTexture"] = {{"index", m.texture}};
    json material = {
        {"name", m.name}, {"doubleSided", m.two_sided}, {"pbrMetallicRoughness", surface}};
    if (m.transmittance > 0.0) {
      use_extension("KHR_materials_transmission");
      use_extension("KHR_materials_ior");
      material["extensions"] = {
          {"KHR_materials_transmission", {{"transmissionFactor", m.transmittance}}},
          {"KHR_materials_ior", {{"ior", m.refraction_index}}}};
    }
    root_["materials"].push_back(material);
  }

  /// Appends to the buffer and returns the accessor's index. Only four-byte components are used, so
  /// that all data stays aligned.
  size_t add_accessor(std::span<const uint8_t> bytes, int component, size_t count, const char* type,
                      int target) {
    const size_t index = root_.contains("accessors") ? root_["accessors"].size() : 0;
    root_["bufferViews"].push_back({{"buffer", 0},
                                    {"byteOffset", buffer_.size()},
                                    {"byteLength", bytes.size()},
                                    {"target", target}});
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
    root_["accessors"].push_back(
        {{"bufferView", index}, {"componentType", component}, {"count", count}, {"type", type}});
    return index;
  }

  template <class T>
  static std::span<const uint8_t> bytes_of(const std::vector<T>& values) {
    return {reinterpret_cast<const uint8_t*>(values.data()), values.size() * sizeof(T)};
  }

  size_t add_vectors(const std::vector<Vec3>& vectors) {
    std::vector<float> numbers;
    numbers.reserve(vectors.size() * 3);
    for (const Vec3& v : vectors)
      for (const double number : {v.x, v.y, v.z}) numbers.push_back(static_cast<float>(number));
    return add_accessor(bytes_of(numbers), kFloat, vectors.size(), "VEC3", kVertices);
  }

  void write_mesh(const render::TriangleMesh& mesh) {
    const size_t positions = add_vectors(mesh.positions);
    Vec3 low = mesh.positions.front();
    Vec3 high = low;
    for (const Vec3 p : mesh.positions) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    // glTF requires the bounds of the numbers as stored.
    const auto stored = [](Vec3 v) {
      return json::array(
          {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)});
    };
    root_["accessors"][positions]["min"] = stored(low);
    root_["accessors"][positions]["max"] = stored(high);
    json attributes = {{"POSITION", positions}};
    if (!mesh.normals.empty()) attributes["NORMAL"] = add_vectors(mesh.normals);
    if (!mesh.uvs.empty())
      attributes["TEXCOORD_0"] =
          add_accessor(bytes_of(mesh.uvs), kFloat, mesh.uvs.size(), "VEC2", kVertices);
    const size_t indices = add_accessor(bytes_of(mesh.triangles), kUnsignedInt,
                                        mesh.triangles.size() * 3, "SCALAR", kIndices);
    const size_t n = root_.contains("meshes") ? root_["meshes"].size() : 0;
    root_["meshes"].push_back({{"name", mesh.name},
                               {"primitives", json::array({{{"attributes", attributes},
                                                            {"indices", indices},
                                                            {"material", mesh.material}}})}});
    add_node({{"mesh", n}});
  }

  void write_light(const render::Light& light) {
    use_extension("KHR_lights_punctual");
    auto& lights = root_["extensions"]["KHR_lights_punctual"]["lights"];
    const double strongest = std::max({light.colour.x, light.colour.y, light.colour.z, 1e-9});
    const Vec3 colour = light.colour / strongest;
    add_node({{"translation", {light.position.x, light.position.y, light.position.z}},
              {"extensions", {{"KHR_lights_punctual", {{"light", lights.size()}}}}}});
    lights.push_back(
        {{"type", "point"}, {"color", {colour.x, colour.y, colour.z}}, {"intensity", strongest}});
    if (!light.falls_off && !said_falloff_)
      out_.notes.emplace_back("lights: fall off with distance in glTF, but not in the scene");
    said_falloff_ |= !light.falls_off;
  }

  void write_camera(const render::Camera& camera) {
    const Vec3 back = normalized(camera.from - camera.at);
    const Vec3 right = normalized(cross(camera.up, back));
    const Vec3 up = cross(back, right);
    const Vec3 from = camera.from;
    add_node({{"camera", 0},
              {"matrix",
               {right.x, right.y, right.z, 0, up.x, up.y, up.z, 0, back.x, back.y, back.z, 0,
                from.x, from.y, from.z, 1}}});
    const double distance = length(camera.from - camera.at);
    root_["cameras"] =
        json::array({{{"type", "perspective"},
                      {"perspective",
                       {{"yfov", camera.vertical_fov_degrees * std::numbers::pi / 180.0},
                        {"znear", camera.hither > 0.0 ? camera.hither : distance / 1000.0}}}}});
    out_.notes.emplace_back("camera: glTF does not store the distance of the point it looks at");
  }

  void finish() {
    root_["buffers"] =
        json::array({{{"byteLength", buffer_.size()},
                      {"uri", "data:application/octet-stream;base64," + base64(buffer_)}}});
    out_.notes.emplace_back("materials: approximated, because glTF has no Whitted materials");
    out_.json = json_text(root_);
    out_.json += '\n';
  }

  const render::SceneDescription& scene_;
  GltfText out_;
  json root_;
  std::vector<uint8_t> buffer_;
  bool said_falloff_ = false;
};

}  // namespace

GltfText write_gltf(const render::SceneDescription& scene) {
  check(scene);
  return GltfWriter(scene).write();
}

}  // namespace lenticule::lab
