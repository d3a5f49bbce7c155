// SPDX-License-Identifier: Apache-2.0
// A glTF file becomes a scene in this order: the document (JSON and buffers, decompressed), the
// materials with their pictures, the nodes parents first, skins, the meshes once per node that
// shows them, the first animation, lights and cameras. Then lights are exposed, and whatever never
// moves is baked to world coordinates. Content that is left out is counted and noted; damaged
// content is an error with the path of its JSON value.
#include "render/loaders/gltf_loader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

#include "base/error.h"
#include "base/file.h"
#include "render/loaders/animation.h"
#include "render/loaders/gltf/document.h"
#include "render/loaders/gltf/materials.h"
#include "render/loaders/gltf/primitives.h"
#include "render/loaders/limits.h"
#include "render/loaders/viewer_choices.h"
#include "render/scene/stage.h"

namespace lenticule::render::gltf {
namespace {

// ---- nodes

/// Nodes imports glTF's node hierarchy with what hangs on it: meshes, skins, cameras and lights.
/// Lifetime: must not outlive document, scene, materials and notes.
class Nodes {
 public:
  /// Imports the hierarchy, parents first. Throws Error(Input) for a node with two parents and for
  /// one that is its own ancestor.
  Nodes(Document& document, SceneDescription& scene, Notes& notes);

  /// Returns the index in the scene of nodes[index].
  [[nodiscard]] int index(size_t index) const { return places_[index]; }

  void import_skins();
  void import_meshes(Materials& materials);
  void import_lights();
  /// Requires the meshes to be in place: a file states the direction in which a camera looks, but
  /// not the distance.
  void import_cameras();

 private:
  void import_hierarchy();
  void mark_shown();
  /// Adds the meshes to the scene, once per instance.
  void show(size_t node, const std::vector<TriangleMesh>& meshes);
  [[nodiscard]] std::vector<int> instances(const JsonAt& node, int place);
  [[nodiscard]] std::shared_ptr<const Deformation> with_skin(
      const std::shared_ptr<const Deformation>& deformation, const JsonAt& node,
      const std::string& mesh) const;

  Document& document_;
  SceneDescription& scene_;
  Notes& notes_;
  const std::vector<JsonAt>& nodes_;
  std::vector<int> places_;    ///< indices in the scene
  std::vector<bool> shown_;    ///< the node belongs to the scene that is shown
  std::vector<size_t> order_;  ///< parents first
  MeshBudget budget_;
};

constexpr size_t kNone = ~size_t{0};

Node node_of(const JsonAt& from) {
  Node node;
  node.name = from.text("name", from.path());
  if (const auto m = from.numbers("matrix", 16)) {
    const std::vector<double>& v = *m;
    node.local = {
        {v[0], v[1], v[2]}, {v[4], v[5], v[6]}, {v[8], v[9], v[10]}, {v[12], v[13], v[14]}};
    return node;
  }
  node.translation = from.vector("translation", {0, 0, 0});
  node.scale = from.vector("scale", {1, 1, 1});
  if (const auto q = from.numbers("rotation", 4)) std::copy_n(q->begin(), 4, node.rotation.begin());
  node.local = compose(node.translation, node.rotation, node.scale);
  return node;
}

std::vector<size_t> children_of(const JsonAt& node, size_t nodes) {
  std::vector<size_t> children;
  for (const JsonAt& child : node.list("children")) children.push_back(child.index(nodes, "nodes"));
  return children;
}

Nodes::Nodes(Document& document, SceneDescription& scene, Notes& notes)
    : document_(document), scene_(scene), notes_(notes), nodes_(document.list("nodes")) {
  if (nodes_.size() > kMaxNodes)
    document.root().at("nodes").fail(fmt::format("more than {} nodes", kMaxNodes));
  import_hierarchy();
  mark_shown();
}

void Nodes::import_hierarchy() {
  std::vector<size_t> parents(nodes_.size(), kNone);
  std::vector<std::vector<size_t>> children(nodes_.size());
  for (size_t i = 0; i < nodes_.size(); ++i) {
    children[i] = children_of(nodes_[i], nodes_.size());
    for (const size_t child : children[i]) {
      if (parents[child] != kNone)
        nodes_[i]
            .at("children")
            .fail(fmt::format("node {} is also a child of node {}", child, parents[child]));
      parents[child] = i;
    }
  }
  places_.assign(nodes_.size(), -1);
  for (size_t i = 0; i < nodes_.size(); ++i)
    if (parents[i] == kNone) order_.push_back(i);
  for (size_t next = 0; next < order_.size(); ++next) {
    const size_t i = order_[next];
    places_[i] = static_cast<int>(next);
    scene_.nodes.push_back(node_of(nodes_[i]));
    scene_.nodes.back().parent = parents[i] == kNone ? -1 : places_[parents[i]];
    order_.insert(order_.end(), children[i].begin(), children[i].end());
  }
  for (size_t i = 0; i < nodes_.size(); ++i)
    if (places_[i] < 0) nodes_[i].fail("is its own ancestor");
}

/// Marks the nodes of the scene that the file names, or of its first; without scenes, all.
void Nodes::mark_shown() {
  const std::vector<JsonAt>& scenes = document_.list("scenes");
  shown_.assign(nodes_.size(), scenes.empty());
  if (scenes.empty()) return;
  const size_t which = document_.root().find_index("scene", scenes.size(), "scenes").value_or(0);
  notes_.count("further scenes in the file left out", scenes.size() - 1);
  for (const JsonAt& root : scenes[which].list("nodes"))
    shown_[root.index(nodes_.size(), "nodes")] = true;
  for (const size_t i : order_)
    if (shown_[i])
      for (const size_t child : children_of(nodes_[i], nodes_.size())) shown_[child] = true;
}

// ---- meshes

void Nodes::import_skins() {
  size_t joints = 0;
  for (const JsonAt& from : document_.list("skins")) {
    Skin skin;
    const JsonAt list = from.at("joints");
    joints += list.size();
    if (joints > kMaxNodes) list.fail(fmt::format("more than {} joints", kMaxNodes));
    for (size_t i = 0; i < list.size(); ++i)
      skin.joints.push_back(places_[list[i].index(nodes_.size(), "nodes")]);
    skin.joint_from_mesh.resize(skin.joints.size());
    if (const auto matrices = from.find("inverseBindMatrices")) {
      const Accessor accessor = accessor_of(document_, *matrices);
      accessor.require("MAT4");
      if (accessor.count() < skin.joints.size())
        matrices->fail(
            fmt::format("{} matrices for {} joints", accessor.count(), skin.joints.size()));
      accessor.each([&](size_t i, const Element& m) {
        if (!std::ranges::all_of(m, [](double v) { return std::isfinite(v); }))
          matrices->fail(fmt::format("matrix {} is not finite", i));
        if (i < skin.joints.size())
          skin.joint_from_mesh[i] = {
              {m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}, {m[12], m[13], m[14]}};
      });
    }
    scene_.skins.push_back(std::move(skin));
  }
}

/// Returns the deformation of a mesh with the skin of a node, if the node has one.
std::shared_ptr<const Deformation> Nodes::with_skin(
    const std::shared_ptr<const Deformation>& deformation, const JsonAt& node,
    const std::string& mesh) const {
  const auto skin = node.find_index("skin", scene_.skins.size(), "skins");
  if (!deformation || !skin || deformation->joints_per_vertex == 0) return deformation;
  const size_t joints = scene_.skins[*skin].joints.size();
  for (size_t i = 0; i < deformation->joints.size(); ++i)
    if (deformation->joints[i] >= joints)
      node.at("skin").fail(fmt::format("mesh '{}' vertex {}: joint {} of {} joints", mesh,
                                       i / deformation->joints_per_vertex, deformation->joints[i],
                                       joints));
  auto skinned = std::make_shared<Deformation>(*deformation);
  skinned->skin = static_cast<int>(*skin);
  return skinned;
}

/// Returns the nodes that show a node's mesh: the node itself, or one more node for each instance
/// of EXT_mesh_gpu_instancing.
std::vector<int> Nodes::instances(const JsonAt& node, int place) {
  const auto instancing = node.extension("EXT_mesh_gpu_instancing");
  if (!instancing) return {place};
  const JsonAt attributes = instancing->at("attributes");
  const auto accessor = [&](const char* name) {
    std::optional<Accessor> found;
    if (const auto member = attributes.find(name)) found = accessor_of(document_, *member);
    return found;
  };
  const auto translations = accessor("TRANSLATION");
  const auto rotations = accessor("ROTATION");
  const auto scales = accessor("SCALE");
  const Accessor* const first = translations ? &*translations
                                : rotations  ? &*rotations
                                : scales     ? &*scales
                                             : nullptr;
  if (first == nullptr) attributes.fail("neither TRANSLATION, ROTATION nor SCALE");
  const size_t count = first->count();
  if (scene_.nodes.size() + count > kMaxNodes)
    attributes.fail(fmt::format("more than {} nodes and instances", kMaxNodes));
  std::vector<Node> nodes(count);
  const auto read = [&](const std::optional<Accessor>& from, const char* type, auto set) {
    if (!from) return;
    from->require(type, count);
    from->each([&](size_t i, const Element& e) {
      if (!std::all_of(e.begin(), e.begin() + 4, [](double v) { return std::isfinite(v); }))
        attributes.fail(fmt::format("instance {} is not finite", i));
      set(nodes[i], e);
    });
  };
  read(translations, "VEC3", [](Node& n, const Element& e) { n.translation = {e[0], e[1], e[2]}; });
  read(scales, "VEC3", [](Node& n, const Element& e) { n.scale = {e[0], e[1], e[2]}; });
  read(rotations, "VEC4",
       [](Node& n, const Element& e) { std::copy_n(e.begin(), 4, n.rotation.begin()); });
  std::vector<int> places;
  for (Node& instance : nodes) {
    instance.parent = place;
    instance.local = compose(instance.translation, instance.rotation, instance.scale);
    instance.morph_weights = scene_.nodes[static_cast<size_t>(place)].morph_weights;
    places.push_back(static_cast<int>(scene_.nodes.size()));
    scene_.nodes.push_back(std::move(instance));
  }
  return places;
}

void Nodes::show(size_t node, const std::vector<TriangleMesh>& meshes) {
  const std::vector<int> places = instances(nodes_[node], places_[node]);
  for (const TriangleMesh& from : meshes) {
    // A skin needs a copy of the deformation, with its morph targets.
    const size_t copies = from.deformation ? 1 + from.deformation->targets.size() : 1;
    budget_.take(from.positions.size() * (places.size() + copies - 1),
                 from.triangles.size() * places.size(), nodes_[node]);
    const auto deformation = with_skin(from.deformation, nodes_[node], from.name);
    for (const int place : places) {
      scene_.meshes.push_back(from);
      TriangleMesh& shown = scene_.meshes.back();
      shown.node = place;
      shown.deformation = deformation;
    }
  }
}

void Nodes::import_meshes(Materials& materials) {
  Primitives primitives(document_, materials, notes_);
  const std::vector<JsonAt>& meshes = document_.list("meshes");
  for (const size_t i : order_) {
    const auto mesh = nodes_[i].find_index("mesh", meshes.size(), "meshes");
    if (!mesh || !shown_[i]) continue;
    const size_t targets = primitives.targets(*mesh);
    if (targets > 0) {
      auto weights = nodes_[i].numbers("weights", targets);
      if (!weights) weights = meshes[*mesh].numbers("weights", targets);
      scene_.nodes[static_cast<size_t>(places_[i])].morph_weights =
          weights.value_or(std::vector<double>(targets));
    }
    show(i, primitives.of_mesh(*mesh));
  }
  primitives.note_repairs(scene_);
  const std::vector<Affine> world = world_from_nodes(scene_.nodes, 0.0);
  for (TriangleMesh& mesh : scene_.meshes) {
    const double volume = std::abs(world[static_cast<size_t>(mesh.node)].determinant());
    if (std::isfinite(volume) && volume > 0.0)
      mesh.material = materials.magnified(mesh.material, std::cbrt(volume));
  }
}

// ---- lights and cameras

void Nodes::import_lights() {
  const auto extension = document_.root().extension("KHR_lights_punctual");
  const std::vector<JsonAt> lights = extension ? extension->list("lights") : std::vector<JsonAt>();
  for (const size_t i : order_) {
    const auto use = nodes_[i].extension("KHR_lights_punctual");
    if (!use || !shown_[i]) continue;
    const JsonAt& from = lights[use->at("light").index(lights.size(), "lights")];
    Light light;
    light.node = places_[i];
    const std::string type = from.at("type").text();
    if (type == "directional") {
      light.kind = Light::Kind::Directional;
    } else if (type == "spot") {
      light.kind = Light::Kind::Spot;
      const auto spot = from.find("spot");
      constexpr double kWidest = std::numbers::pi / 2.0;
      const auto angle = [&](const char* key, double otherwise) {
        return spot ? spot->number_within(key, otherwise, 0.0, kWidest) : otherwise;
      };
      light.cos_inner = std::cos(angle("innerConeAngle", 0.0));
      light.cos_outer =
          std::min(std::cos(angle("outerConeAngle", std::numbers::pi / 4.0)), light.cos_inner);
    } else if (type != "point") {
      from.at("type").fail("expected directional, point or spot");
    }
    light.falls_off = light.kind != Light::Kind::Directional;
    constexpr double kBrightest = 1e12;
    light.colour =
        from.vector("color", {1, 1, 1}) * from.number_within("intensity", 1.0, 0.0, kBrightest);
    if (from.find("range")) notes_.count("light ranges ignored: light falls off by distance alone");
    if (!(light.colour.x + light.colour.y + light.colour.z > 0.0)) {
      notes_.count("lights that shine on nothing");
      continue;
    }
    if (scene_.lights.size() == kMaxLights)
      nodes_[i].fail(fmt::format("more than {} lights", kMaxLights));
    scene_.lights.push_back(light);
  }
}

void Nodes::import_cameras() {
  const std::vector<JsonAt>& cameras = document_.list("cameras");
  // In the order of the file's cameras, then of the nodes that use one.
  std::vector<std::pair<size_t, size_t>> uses;
  for (size_t i = 0; i < nodes_.size(); ++i)
    if (const auto camera = nodes_[i].find_index("camera", cameras.size(), "cameras"))
      if (shown_[i]) uses.emplace_back(*camera, i);
  std::ranges::sort(uses);
  const Bounds bounds = uses.empty() ? Bounds{} : scene_bounds(scene_);
  for (const auto& [index, node] : uses) {
    const JsonAt& from = cameras[index];
    Camera camera;
    camera.name = nodes_[node].text("name", from.text("name", from.path()));
    camera.node = places_[node];
    camera.from = {0, 0, 0};
    camera.at = {0, 0, -1};
    camera.up = {0, 1, 0};
    const std::string type = from.at("type").text();
    if (type != "perspective" && type != "orthographic")
      from.at("type").fail("expected perspective or orthographic");
    const JsonAt lens = from.at(type == "orthographic" ? "orthographic" : "perspective");
    camera.hither = std::max(0.0, lens.number("znear", 0.0));
    constexpr double kDegrees = 180.0 / std::numbers::pi;
    if (type == "perspective") camera.vertical_fov_degrees = lens.at("yfov").number() * kDegrees;
    if (!is_usable(camera) || bounds.empty()) {
      notes_.count("unusable cameras left out");
      continue;
    }
    focus(camera, scene_, bounds);
    if (type == "orthographic") {
      // The perspective view that shows the same height at the look-at point.
      const double distance = length(camera.at - camera.from);
      const double half_height = std::abs(lens.at("ymag").number());
      camera.vertical_fov_degrees =
          std::clamp(2.0 * std::atan(half_height / distance) * kDegrees, 1e-3, 179.0);
      scene_.notes.push_back(
          fmt::format("orthographic camera '{}' treated as a perspective one", camera.name));
    }
    scene_.cameras.push_back(camera);
  }
}

// ---- animations
// Imports key frames from glTF.

constexpr double kLongestSeconds = 1e7;

enum class Interpolation { Linear, Step, CubicSpline };

Interpolation interpolation_of(const JsonAt& sampler) {
  const std::string name = sampler.text("interpolation", "LINEAR");
  if (name == "LINEAR") return Interpolation::Linear;
  if (name == "STEP") return Interpolation::Step;
  if (name == "CUBICSPLINE") return Interpolation::CubicSpline;
  sampler.at("interpolation").fail("expected LINEAR, STEP or CUBICSPLINE");
}

void assign(Vec3& to, const double* from) {
  to = {from[0], from[1], from[2]};
}
void assign(std::array<double, 4>& to, const double* from) {
  std::copy_n(from, 4, to.begin());
}
void assign(std::vector<double>& to, const double* from) {
  std::copy_n(from, to.size(), to.begin());
}

class AnimationImport {
 public:
  AnimationImport(Document& document, SceneDescription& scene, Notes& notes)
      : document_(document), scene_(scene), notes_(notes) {}

  void add(const JsonAt& channel, const std::vector<JsonAt>& samplers, const Nodes& nodes) {
    const std::vector<JsonAt>& list = document_.list("nodes");
    const JsonAt target = channel.at("target");
    const std::string path = target.at("path").text();
    const auto index = target.find_index("node", list.size(), "nodes");
    const JsonAt& sampler = samplers[channel.at("sampler").index(samplers.size(), "samplers")];
    if (!index) {
      notes_.count("animation channels without a node left out");
      return;
    }
    Node& node = scene_.nodes[static_cast<size_t>(nodes.index(*index))];
    if (path == "weights") {
      if (!node.morph_weights.empty())
        read(sampler, "SCALAR", node.morph_weights, node.morph_weights.size(),
             node.morph_weight_keys);
      return;
    }
    if (list[*index].find("matrix"))
      target.at("node").fail(
          fmt::format("node {} has a matrix; an animated node needs translation, rotation and "
                      "scale instead",
                      *index));
    if (path == "translation")
      read(sampler, "VEC3", node.translation, 1, node.translations);
    else if (path == "rotation")
      read(sampler, "VEC4", node.rotation, 1, node.rotations);
    else if (path == "scale")
      read(sampler, "VEC3", node.scale, 1, node.scales);
    else
      return notes_.count("animation channels of unknown properties left out");
    node.animated = true;
  }

 private:
  std::vector<double> times_of(const JsonAt& sampler) {
    const Accessor input = accessor_of(document_, sampler.at("input"));
    input.require("SCALAR");
    take_keys(input.count(), sampler);
    std::vector<double> times(input.count());
    input.each([&](size_t i, const Element& e) {
      if (!(std::abs(e[0]) <= kLongestSeconds))
        sampler.at("input").fail(fmt::format("key frame {} is not finite or too late", i));
      times[i] = e[0];
    });
    return times;
  }

  void take_keys(size_t count, const JsonAt& sampler) {
    if ((keys_ += count) > kMaxKeys) sampler.fail(fmt::format("more than {} key frames", kMaxKeys));
  }

  /// Reads the keys of one property; `rest` is its value without keys. A value consists of
  /// `elements` elements of the output accessor.
  template <class T>
  void read(const JsonAt& sampler, const char* type, const T& rest, size_t elements,
            Channel<T>& channel) {
    const Interpolation interpolation = interpolation_of(sampler);
    const std::vector<double> times = times_of(sampler);
    // In-tangent, value and out-tangent.
    const size_t values_per_key = interpolation == Interpolation::CubicSpline ? 3 : 1;
    const Accessor output = accessor_of(document_, sampler.at("output"));
    output.require(type, times.size() * values_per_key * elements);
    take_keys(output.count(), sampler);
    const size_t components = output.components();
    std::vector<double> numbers(output.count() * components);
    output.each([&](size_t i, const Element& e) {
      for (size_t k = 0; k < components; ++k) {
        if (!std::isfinite(e[k]))
          sampler.at("output").fail(fmt::format("element {} is not finite", i));
        numbers[i * components + k] = e[k];
      }
    });
    const size_t value_size = elements * components;
    const auto value = [&](size_t number) {
      T value_read = rest;
      assign(value_read, numbers.data() + number * value_size);
      return value_read;
    };
    channel = {};
    channel.steps = interpolation == Interpolation::Step;
    for (size_t i = 0; i < times.size(); ++i) {
      if (!channel.times.empty() && times[i] <= channel.times.back()) {
        notes_.count("key frames out of order dropped");
        continue;
      }
      channel.times.push_back(times[i]);
      scene_.duration_seconds = std::max(scene_.duration_seconds, times[i]);
      if (values_per_key == 1) {
        channel.values.push_back(value(i));
        continue;
      }
      channel.in_tangents.push_back(value(3 * i));
      channel.values.push_back(value(3 * i + 1));
      channel.out_tangents.push_back(value(3 * i + 2));
    }
  }

  Document& document_;
  SceneDescription& scene_;
  Notes& notes_;
  size_t keys_ = 0;
};

/// Imports the first animation of the file, after the meshes.
void import_animation(Document& document, const Nodes& nodes, SceneDescription& scene,
                      Notes& notes) {
  const std::vector<JsonAt>& animations = document.list("animations");
  if (animations.empty()) return;
  if (animations.size() > 1)
    scene.notes.push_back(fmt::format("{} animations, the first is played", animations.size()));
  AnimationImport import(document, scene, notes);
  const std::vector<JsonAt> samplers = animations[0].list("samplers");
  for (const JsonAt& channel : animations[0].list("channels")) import.add(channel, samplers, nodes);
  // The nodes of instances come after those of the file.
  for (size_t i = document.list("nodes").size(); i < scene.nodes.size(); ++i)
    scene.nodes[i].morph_weight_keys =
        scene.nodes[static_cast<size_t>(scene.nodes[i].parent)].morph_weight_keys;
}

}  // namespace

}  // namespace lenticule::render::gltf

namespace lenticule::render {
namespace {

// ---- loader

using gltf::Document;
using gltf::JsonAt;

constexpr std::array<std::string_view, 18> kExtensions{"EXT_mesh_gpu_instancing",
                                                       "EXT_meshopt_compression",
                                                       "EXT_texture_webp",
                                                       "KHR_draco_mesh_compression",
                                                       "KHR_lights_punctual",
                                                       "KHR_materials_anisotropy",
                                                       "KHR_materials_clearcoat",
                                                       "KHR_materials_emissive_strength",
                                                       "KHR_materials_ior",
                                                       "KHR_materials_iridescence",
                                                       "KHR_materials_pbrSpecularGlossiness",
                                                       "KHR_materials_sheen",
                                                       "KHR_materials_specular",
                                                       "KHR_materials_transmission",
                                                       "KHR_materials_unlit",
                                                       "KHR_materials_volume",
                                                       "KHR_mesh_quantization",
                                                       "KHR_texture_transform"};

/// Metadata; leaving it out changes nothing.
constexpr std::array<std::string_view, 2> kWithoutEffect{"KHR_xmp_json_ld", "KHR_xmp"};

void check_version(const JsonAt& root) {
  const JsonAt version = root.at("asset").at("version");
  const std::string text = version.text();
  if (!text.starts_with("2.")) version.fail(fmt::format("glTF {}, expected 2", text.substr(0, 16)));
}

void check_extensions(const JsonAt& root, SceneDescription& scene) {
  for (const JsonAt& name : root.list("extensionsRequired")) {
    if (name.text() == "KHR_texture_basisu")
      throw Error(ErrorKind::Input,
                  fmt::format("{}: {}: KHR_texture_basisu: KTX2 textures are not read",
                              scene.source, name.path()),
                  "convert the model: gltf-transform ktxdecompress IN.glb OUT.glb");
    if (std::ranges::find(kExtensions, name.text()) == kExtensions.end())
      name.fail(fmt::format("unknown extension '{}'", name.text().substr(0, 80)));
  }
  std::string unknown;
  for (const JsonAt& name : root.list("extensionsUsed"))
    if (std::ranges::find(kExtensions, name.text()) == kExtensions.end() &&
        std::ranges::find(kWithoutEffect, name.text()) == kWithoutEffect.end())
      unknown += (unknown.empty() ? "" : ", ") + name.text().substr(0, 80);
  if (!unknown.empty()) scene.notes.push_back("extensions ignored: " + unknown);
}

}  // namespace

SceneDescription parse_gltf(std::vector<uint8_t> bytes, const std::string& source,
                            const std::optional<std::filesystem::path>& folder) {
  SceneDescription scene;
  scene.source = source;
  scene.colour_managed = true;
  try {
    Document document(std::move(bytes), source, folder);
    check_version(document.root());
    check_extensions(document.root(), scene);
    gltf::Notes notes;
    gltf::Materials materials(document, scene, notes);
    gltf::Nodes nodes(document, scene, notes);
    nodes.import_skins();
    nodes.import_meshes(materials);
    if (scene.meshes.empty()) {
      notes.write(scene);
      refuse_empty(scene);
    }
    gltf::import_animation(document, nodes, scene, notes);
    nodes.import_lights();
    nodes.import_cameras();
    notes.write(scene);
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::Input, source + ": needs more memory than is available");
  }
  expose(scene);
  bake_still_nodes(scene);
  return scene;
}

SceneDescription load_gltf(const std::filesystem::path& file) {
  return parse_gltf(read_whole_file(file, kMaxSceneFileBytes), file.string(), file.parent_path());
}

}  // namespace lenticule::render
