// SPDX-License-Identifier: Apache-2.0
// A glTF file becomes a scene in this order: the document (JSON and buffers, decompressed), the
// nodes parents first, the materials with their pictures, skins, the meshes once per node that
// shows them, the chosen animations, lights and cameras. Then lights are exposed, and objects that
// never move are baked to world coordinates. Content that is left out is counted and noted; damaged
// content is an error with the path of its JSON value.
#include <draco/compression/decode.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <string_view>
#include <vector>

#include "base/error_kinds.h"
#include "render/loaders/animation.h"
#include "render/loaders/formats.h"
#include "render/loaders/gltf/document.h"
#include "render/loaders/gltf/materials.h"
#include "render/loaders/mesh_cleanup.h"
#include "render/loaders/viewer_choices.h"
#include "render/scene/stage.h"

namespace lenticule::render::gltf {
namespace {

// A primitive is a list of triangles of one material. Its vertex attributes come from accessors or
// from Draco data; strips and fans become triangles, tangents are computed where a material needs
// them, and morph targets and the weights of joints are kept for the animation.

// ---- draco mesh

/// Takes a number of seven bits per byte from the front of the data.
uint64_t take_varint(Bytes& bytes) {
  uint64_t value = 0;
  for (int shift = 0; shift < 63 && !bytes.empty(); shift += 7) {
    const uint8_t byte = bytes.front();
    bytes = bytes.subspan(1);
    value |= uint64_t{byte & 0x7FU} << shift;
    if ((byte & 0x80U) == 0) break;
  }
  return value;
}

/// Refuses numbers of faces and vertices that so little data cannot hold: the decoder allocates
/// memory for them. The header is "DRACO", version (2 bytes), kind, method, flags (2 bytes); then
/// come the numbers, after the kind of traversal for method 1 (edgebreaker).
void check_header(Bytes bytes, const JsonAt& extension) {
  constexpr size_t kHeaderBytes = 11;
  constexpr size_t kMethodAt = 8;
  constexpr uint8_t kMetadata = 0x80;  // in the second byte of the flags
  constexpr uint64_t kMostPerByte = 1024;
  const uint64_t most = kMostPerByte * bytes.size();
  if (bytes.size() <= kHeaderBytes + 1 || (bytes[kHeaderBytes - 1] & kMetadata) != 0) return;
  Bytes numbers = bytes.subspan(kHeaderBytes + (bytes[kMethodAt] == 1 ? 1 : 0));
  const uint64_t first = take_varint(numbers);
  const uint64_t second = take_varint(numbers);
  if (first > most || second > most)
    extension.fail(fmt::format("{} and {} faces and vertices in {} bytes of Draco data", first,
                               second, bytes.size()));
}

/// DracoMesh decodes the compressed geometry of KHR_draco_mesh_compression.
class DracoMesh {
 public:
  /// `extension` is for messages. Throws Error(Input) for damaged data.
  DracoMesh(Bytes bytes, const JsonAt& extension) {
    check_header(bytes, extension);
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    auto result = draco::Decoder().DecodeMeshFromBuffer(&buffer);
    if (!result.ok()) extension.fail("damaged Draco data");
    mesh_ = std::move(result).value();
    if (mesh_->num_points() > kMaxVertices || mesh_->num_faces() > kMaxTriangles)
      extension.fail(
          fmt::format("more than {} triangles or {} vertices", kMaxTriangles, kMaxVertices));
  }

  [[nodiscard]] size_t vertices() const { return mesh_->num_points(); }

  /// Returns the corners of all triangles, each less than vertices().
  [[nodiscard]] std::vector<uint32_t> corners() const {
    const draco::Mesh& mesh = *mesh_;
    std::vector<uint32_t> corners;
    corners.reserve(size_t{3} * mesh.num_faces());
    for (uint32_t face = 0; face < mesh.num_faces(); ++face)
      for (const draco::PointIndex& point : mesh.face(draco::FaceIndex(face)))
        corners.push_back(point.value());
    return corners;
  }

  /// Calls `take` for every vertex with the attribute of a number that the extension assigns. The
  /// accessor states the number of components, and whether integers are normalized.
  void each(const JsonAt& attribute, const Accessor& accessor, const TakeElement& take) const {
    const uint64_t number = attribute.whole();
    const draco::PointAttribute* const values =
        number <= UINT32_MAX ? mesh_->GetAttributeByUniqueId(static_cast<uint32_t>(number))
                             : nullptr;
    if (values == nullptr)
      attribute.fail(fmt::format("{} is no attribute of the compressed mesh", number));
    const bool normalizes = accessor.is_normalized() && !values->normalized();
    const auto components = static_cast<int8_t>(accessor.components());
    for (uint32_t i = 0; i < mesh_->num_points(); ++i) {
      const draco::AttributeValueIndex place = values->mapped_index(draco::PointIndex(i));
      Element element{};
      if (place.value() >= values->size() ||
          !values->ConvertValue<double>(place, components, element.data()))
        attribute.fail("damaged Draco data");
      if (normalizes)
        for (double& value : element) value = accessor.component().normalized(value);
      take(i, element);
    }
  }

 private:
  std::unique_ptr<const draco::Mesh> mesh_;
};

// ---- attributes

/// Corners of the triangles of primitives by their mode; other modes are points and lines.
enum Mode : uint64_t { Triangles = 4, TriangleStrip = 5, TriangleFan = 6 };
constexpr uint64_t kLastMode = 6;

/// Attributes reads the vertex attributes of a primitive, compressed by Draco or not.
class Attributes {
 public:
  Attributes(Document& document, const JsonAt& primitive)
      : document_(document), attributes_(primitive.at("attributes")) {
    const auto extension = primitive.extension("KHR_draco_mesh_compression");
    if (!extension) return;
    const size_t view =
        extension->at("bufferView").index(document.list("bufferViews").size(), "buffer views");
    draco_ = std::make_unique<DracoMesh>(document.view(view).bytes, *extension);
    compressed_ = extension->at("attributes");
  }

  [[nodiscard]] const DracoMesh* draco() const { return draco_.get(); }
  [[nodiscard]] bool has(const std::string& name) const {
    return attributes_.find(name.c_str()).has_value();
  }
  [[nodiscard]] Accessor accessor(const std::string& name) const {
    return accessor_of(document_, attributes_.at(name.c_str()));
  }
  /// Returns the number of values of an attribute.
  [[nodiscard]] size_t count(const std::string& name) const {
    return is_compressed(name) ? draco_->vertices() : accessor(name).count();
  }
  /// Calls `take` with the values of an attribute of this type and number.
  void each(const std::string& name, const char* type, size_t count,
            const TakeElement& take) const {
    const Accessor values = accessor(name);
    if (!is_compressed(name)) {
      values.require(type, count);
      return values.each(take);
    }
    values.require(type);
    const JsonAt attribute = compressed_->at(name.c_str());
    if (draco_->vertices() != count)
      attribute.fail(fmt::format("{} vertices, expected {}", draco_->vertices(), count));
    draco_->each(attribute, values, take);
  }
  [[nodiscard]] JsonAt at(const std::string& name) const { return attributes_.at(name.c_str()); }

 private:
  [[nodiscard]] bool is_compressed(const std::string& name) const {
    return compressed_ && compressed_->find(name.c_str());
  }

  Document& document_;
  JsonAt attributes_;
  std::unique_ptr<DracoMesh> draco_;
  std::optional<JsonAt> compressed_;
};

std::vector<std::string> names_of(const std::vector<JsonAt>& list) {
  std::vector<std::string> names;
  for (const JsonAt& one : list) names.push_back(one.text("name", ""));
  return names;
}

/// Returns the material that the variant gives a primitive, or else its own.
std::optional<size_t> material_of(Document& document, const Selection& variants,
                                  const JsonAt& primitive) {
  const size_t materials = document.list("materials").size();
  if (const auto extension = primitive.extension("KHR_materials_variants"))
    for (const JsonAt& mapping : extension->list("mappings"))
      for (const JsonAt& variant : mapping.list("variants"))
        if (variants.takes(variant.index(variants.names.size(), "variants")))
          return mapping.at("material").index(materials, "materials");
  return primitive.find_index("material", materials, "materials");
}

Vec3 vec3(const Element& e) { return {e[0], e[1], e[2]}; }

std::vector<Vec3> positions_of(const Attributes& attributes, size_t count,
                               const std::string& name) {
  std::vector<Vec3> positions(count);
  attributes.each("POSITION", "VEC3", count, [&](size_t i, const Element& e) {
    positions[i] = vec3(e);
    if (const char* flaw = flaw_of(positions[i]))
      attributes.at("POSITION").fail(fmt::format("mesh '{}' vertex {} is {}", name, i, flaw));
  });
  return positions;
}

/// Returns `convert(vertex, element)` for all vertices; empty without the attribute.
template <class Convert>
auto values_of(const Attributes& attributes, const std::string& name, const char* type,
               size_t count, const Convert& convert) {
  std::vector<decltype(convert(size_t{0}, Element{}))> values;
  if (!attributes.has(name)) return values;
  values.resize(count);
  attributes.each(name, type, count,
                  [&](size_t i, const Element& e) { values[i] = convert(i, e); });
  return values;
}

std::vector<Vec3> normals_of(const Attributes& attributes, size_t count) {
  return values_of(attributes, "NORMAL", "VEC3", count,
                   [](size_t, const Element& e) { return vec3(e); });
}

std::vector<std::array<float, 2>> uvs_of(const Attributes& attributes, size_t count, uint64_t set) {
  return values_of(attributes, fmt::format("TEXCOORD_{}", set), "VEC2", count,
                   [](size_t, const Element& e) { return usable_uv(e[0], e[1]); });
}

std::vector<std::array<float, 4>> colours_of(const Attributes& attributes, size_t count) {
  if (!attributes.has("COLOR_0")) return {};
  const bool with_alpha = attributes.accessor("COLOR_0").components() == 4;
  const auto share = [](double v) {
    return static_cast<float>(std::isfinite(v) ? std::clamp(v, 0.0, 1.0) : 0.0);
  };
  return values_of(
      attributes, "COLOR_0", with_alpha ? "VEC4" : "VEC3", count, [&](size_t, const Element& e) {
        return std::array{share(e[0]), share(e[1]), share(e[2]), with_alpha ? share(e[3]) : 1.0F};
      });
}

/// Reads tangents and makes them unit vectors. They belong to normals and mean nothing without.
std::vector<std::array<float, 4>> tangents_of(const Attributes& attributes, size_t count,
                                              const std::vector<Vec3>& normals) {
  if (normals.empty()) return {};
  return values_of(attributes, "TANGENT", "VEC4", count, [&](size_t i, const Element& e) {
    Vec3 direction = normalized(vec3(e));
    if (!(length(direction) > 0.5) || !is_finite(direction))
      direction = is_finite(normals[i]) && !(normals[i] == Vec3{})
                      ? any_perpendicular(normalized(normals[i]))
                      : Vec3{1, 0, 0};
    const Vec3f unit(direction);
    return std::array{unit.x, unit.y, unit.z, e[3] < 0.0 ? -1.0F : 1.0F};
  });
}

// ---- triangles

/// Returns the vertices in the order in which the mode forms triangles of them.
std::vector<uint32_t> indices_of(Document& document, const JsonAt& primitive,
                                 const Attributes& attributes, size_t vertices) {
  std::vector<uint32_t> indices;
  const auto member = primitive.find("indices");
  if (attributes.draco() != nullptr) {
    indices = attributes.draco()->corners();
  } else if (member) {
    const Accessor accessor = accessor_of(document, *member);
    accessor.require("SCALAR");
    if (!accessor.component().is_unsigned)
      accessor.at().at("componentType").fail("indices need unsigned integers");
    if (accessor.is_normalized()) accessor.at().at("normalized").fail("indices are not normalized");
    indices.resize(accessor.count());
    accessor.each([&](size_t i, const Element& e) { indices[i] = static_cast<uint32_t>(e[0]); });
  } else {
    indices.resize(vertices);
    std::iota(indices.begin(), indices.end(), 0U);
  }
  for (size_t i = 0; i < indices.size(); ++i)
    if (indices[i] >= vertices)
      (member ? *member : primitive)
          .fail(fmt::format("element {}: {} of {} vertices", i, indices[i], vertices));
  return indices;
}

std::vector<std::array<uint32_t, 3>> triangles_of(uint64_t mode,
                                                  const std::vector<uint32_t>& corners) {
  std::vector<std::array<uint32_t, 3>> triangles;
  const size_t step = mode == Triangles ? 3 : 1;
  triangles.reserve(corners.size() / step);
  for (size_t i = 0; i + 2 < corners.size(); i += step) {
    if (mode == TriangleFan)
      triangles.push_back({corners[i + 1], corners[i + 2], corners[0]});
    else if (mode == TriangleStrip && i % 2 == 1)
      triangles.push_back({corners[i], corners[i + 2], corners[i + 1]});
    else
      triangles.push_back({corners[i], corners[i + 1], corners[i + 2]});
  }
  return triangles;
}

// ---- deformation

double limited(double value, double high) {
  return std::isfinite(value) ? std::clamp(value, 0.0, high) : 0.0;
}

/// Reads the joints and weights of all sets; the weights of each vertex are scaled to the sum 1.
void read_joints(const Attributes& attributes, size_t vertices, Deformation& to) {
  size_t sets = 0;
  while (attributes.has(fmt::format("JOINTS_{}", sets)) &&
         attributes.has(fmt::format("WEIGHTS_{}", sets)))
    ++sets;
  if (sets == 0) return;
  constexpr size_t kMostSets = 4;
  if (sets > kMostSets)
    attributes.at("JOINTS_4").fail(fmt::format("{} sets of joints, at most {}", sets, kMostSets));
  constexpr size_t kPerSet = 4;
  const size_t per_vertex = sets * kPerSet;
  to.joints_per_vertex = per_vertex;
  to.joints.resize(vertices * per_vertex);
  to.weights.resize(vertices * per_vertex);
  for (size_t set = 0; set < sets; ++set) {
    attributes.each(fmt::format("JOINTS_{}", set), "VEC4", vertices,
                    [&](size_t i, const Element& e) {
                      for (size_t k = 0; k < kPerSet; ++k)
                        to.joints[i * per_vertex + set * kPerSet + k] =
                            static_cast<uint16_t>(limited(e[k], 65535.0));
                    });
    attributes.each(
        fmt::format("WEIGHTS_{}", set), "VEC4", vertices, [&](size_t i, const Element& e) {
          for (size_t k = 0; k < kPerSet; ++k)
            to.weights[i * per_vertex + set * kPerSet + k] = static_cast<float>(limited(e[k], 1e6));
        });
  }
  for (size_t i = 0; i < vertices; ++i) {
    float* const weights = to.weights.data() + i * per_vertex;
    const float sum = std::accumulate(weights, weights + per_vertex, 0.0F);
    if (sum > 0.0F)
      std::for_each(weights, weights + per_vertex, [&](float& w) { w /= sum; });
    else
      weights[0] = 1.0F;
  }
}

std::vector<Vec3f> offsets_of(Document& document, const JsonAt& target, const char* name,
                              size_t vertices) {
  std::vector<Vec3f> offsets;
  const auto member = target.find(name);
  if (!member) return offsets;
  const Accessor accessor = accessor_of(document, *member);
  accessor.require("VEC3", vertices);
  offsets.resize(vertices);
  accessor.each([&](size_t i, const Element& e) {
    if (const char* flaw = flaw_of(vec3(e))) member->fail(fmt::format("vertex {} is {}", i, flaw));
    offsets[i] = Vec3f(vec3(e));
  });
  return offsets;
}

/// MeshBudget limits the vertices and triangles of a scene before memory is allocated for them.
class MeshBudget {
 public:
  /// Throws Error(Input) through `where` if the total exceeds a limit.
  void take(size_t vertices, size_t triangles, const JsonAt& where) {
    vertices_ += vertices;
    triangles_ += triangles;
    if (vertices_ > kMaxVertices || triangles_ > kMaxTriangles)
      where.fail(fmt::format("more than {} triangles or {} vertices in the scene", kMaxTriangles,
                             kMaxVertices));
  }

 private:
  size_t vertices_ = 0;
  size_t triangles_ = 0;
};

/// Lifetime: must not outlive document, materials, variants and notes.
class Primitives {
 public:
  Primitives(Document& document, Materials& materials, const Selection& variants, Notes& notes)
      : document_(document), materials_(materials), variants_(variants), notes_(notes) {}

  /// Returns the primitives of meshes[index] that have triangles, in the mesh's coordinates. A
  /// deformation has no skin yet.
  [[nodiscard]] std::vector<TriangleMesh>& of_mesh(size_t index) {
    const auto [known, added] = meshes_.try_emplace(index);
    if (!added) return known->second;
    const JsonAt& mesh = document_.list("meshes")[index];
    const std::string name = mesh.text("name", mesh.path());
    const JsonAt primitives = mesh.at("primitives");
    for (size_t i = 0; i < primitives.size(); ++i) {
      const JsonAt primitive = primitives[i];
      const uint64_t mode = primitive.whole("mode", Triangles);
      if (mode > kLastMode) primitive.at("mode").fail(fmt::format("{} of 7 modes", mode));
      if (mode < Triangles) {
        notes_.count("primitives of points or lines left out");
        continue;
      }
      if (!primitive.at("attributes").find("POSITION")) {
        notes_.count("primitives without positions left out");
        continue;
      }
      TriangleMesh triangles = read(primitive, name);
      if (!triangles.triangles.empty()) known->second.push_back(std::move(triangles));
    }
    return known->second;
  }

  /// Returns the number of morph targets of meshes[index].
  [[nodiscard]] size_t targets(size_t index) {
    const JsonAt primitives = document_.list("meshes")[index].at("primitives");
    return primitives.size() == 0 ? 0 : primitives[0].list("targets").size();
  }

  /// Notes repaired triangles and normals, and meshes whose coordinates are coarse.
  void note_repairs(SceneDescription& scene) const {
    repairs_.write(scene);
    digits_.write(scene);
  }

 private:
  [[nodiscard]] TriangleMesh read(const JsonAt& primitive, const std::string& name) {
    TriangleMesh mesh;
    mesh.name = name;
    const Attributes attributes(document_, primitive);
    const size_t vertices = attributes.count("POSITION");
    const std::vector<JsonAt> targets = primitive.list("targets");
    // Counts the vertices of morph targets as well.
    constexpr size_t kMostTargets = size_t{1} << 16;
    if (targets.size() > kMostTargets)
      primitive.at("targets").fail(fmt::format("more than {} morph targets", kMostTargets));
    budget_.take(vertices * (1 + targets.size()), 0, primitive);

    mesh.material = materials_.index(material_of(document_, variants_, primitive));
    const MaterialInput& input = materials_.input(mesh.material);
    mesh.positions = positions_of(attributes, vertices, name);
    digits_.add(mesh);
    mesh.normals = normals_of(attributes, vertices);
    mesh.tangents = tangents_of(attributes, vertices, mesh.normals);
    mesh.uvs = uvs_of(attributes, vertices, input.uv_sets[0]);
    if (input.uv_sets.size() > 1) mesh.uvs2 = uvs_of(attributes, vertices, input.uv_sets[1]);
    mesh.colours = colours_of(attributes, vertices);

    const std::vector<uint32_t> corners = indices_of(document_, primitive, attributes, vertices);
    const uint64_t mode = attributes.draco() != nullptr ? Triangles : primitive.whole("mode", 4);
    budget_.take(0, mode == Triangles ? corners.size() / 3 : corners.size(), primitive);
    mesh.triangles = triangles_of(mode, corners);

    auto deformation = std::make_shared<Deformation>();
    read_joints(attributes, vertices, *deformation);
    for (const JsonAt& target : targets)
      deformation->targets.push_back({offsets_of(document_, target, "POSITION", vertices),
                                      offsets_of(document_, target, "NORMAL", vertices),
                                      offsets_of(document_, target, "TANGENT", vertices)});
    const bool deformed = !deformation->targets.empty() || deformation->joints_per_vertex > 0;
    if (deformed) {
      // The deformation may give a triangle an area, so all stay. Each frame's mesh is cleaned
      // later.
      for (Vec3& normal : mesh.normals) normal = normalized(is_finite(normal) ? normal : Vec3{});
      mesh.deformation = std::move(deformation);
    } else {
      repairs_ += clean(mesh);
    }
    if (mesh.tangents.empty() && input.tangent_uvs) compute_tangents(mesh, *input.tangent_uvs == 1);
    return mesh;
  }

  Document& document_;
  Materials& materials_;
  const Selection& variants_;
  Notes& notes_;
  std::map<size_t, std::vector<TriangleMesh>> meshes_;
  MeshBudget budget_;
  MeshRepairs repairs_;
  LostDigits digits_;
};

// ---- nodes

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

// ---- what hangs on nodes

/// Nodes imports glTF's node hierarchy with what hangs on it: meshes, skins, cameras and lights.
/// Lifetime: must not outlive document, scene, materials and notes.
class Nodes {
 public:
  /// Imports the hierarchy, parents first. Throws Error(Input) for a node with two parents and for
  /// one that is its own ancestor.
  Nodes(Document& document, SceneDescription& scene, Notes& notes)
      : document_(document),
        scene_(scene),
        notes_(notes),
        nodes_(document.list("nodes")),
        uses_(document.list("meshes").size()) {
    if (nodes_.size() > kMaxNodes)
      document.root().at("nodes").fail(fmt::format("more than {} nodes", kMaxNodes));
    import_hierarchy();
    mark_shown();
    for (const size_t i : order_)
      if (const auto mesh = shown_mesh(i)) ++uses_[*mesh];
  }

  /// Returns the index in the scene of nodes[index].
  [[nodiscard]] int index(size_t index) const { return places_[index]; }

  void import_skins() {
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

  /// Returns for each material of the file whether a mesh that is shown uses it.
  [[nodiscard]] std::vector<bool> used_materials() const {
    std::vector<bool> used(document_.list("materials").size());
    for (size_t mesh = 0; mesh < uses_.size(); ++mesh) {
      if (uses_[mesh] == 0) continue;
      const JsonAt primitives = document_.list("meshes")[mesh].at("primitives");
      for (size_t k = 0; k < primitives.size(); ++k)
        if (const auto m = material_of(document_, scene_.variants, primitives[k])) used[*m] = true;
    }
    return used;
  }

  void import_meshes(Materials& materials) {
    Primitives primitives(document_, materials, scene_.variants, notes_);
    const std::vector<JsonAt>& meshes = document_.list("meshes");
    for (const size_t i : order_) {
      const auto mesh = shown_mesh(i);
      if (!mesh) continue;
      const size_t targets = primitives.targets(*mesh);
      if (targets > 0) {
        auto weights = nodes_[i].numbers("weights", targets);
        if (!weights) weights = meshes[*mesh].numbers("weights", targets);
        scene_.nodes[static_cast<size_t>(places_[i])].morph_weights =
            weights.value_or(std::vector<double>(targets));
      }
      show(i, primitives.of_mesh(*mesh), uses_[*mesh] > 1);
    }
    primitives.note_repairs(scene_);
    const std::vector<Affine> world = world_from_nodes(scene_.nodes, 0.0);
    for (TriangleMesh& mesh : scene_.meshes) {
      const double volume = std::abs(world[static_cast<size_t>(mesh.node)].determinant());
      if (std::isfinite(volume) && volume > 0.0)
        mesh.material = materials.magnified(mesh.material, std::cbrt(volume));
    }
  }

  void import_lights() {
    const auto extension = document_.root().extension("KHR_lights_punctual");
    const std::vector<JsonAt> lights =
        extension ? extension->list("lights") : std::vector<JsonAt>();
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
      if (from.find("range"))
        notes_.count("light ranges ignored: light falls off by distance alone");
      if (!(light.colour.x + light.colour.y + light.colour.z > 0.0)) {
        notes_.count("lights that shine on nothing");
        continue;
      }
      if (scene_.lights.size() == kMaxLights)
        nodes_[i].fail(fmt::format("more than {} lights", kMaxLights));
      scene_.lights.push_back(light);
    }
  }

  /// Requires the meshes to be in place: a file states the direction in which a camera looks, but
  /// not the distance.
  void import_cameras() {
    const std::vector<JsonAt>& cameras = document_.list("cameras");
    // In the order of the file's cameras, then of the nodes that use one.
    std::vector<std::pair<size_t, size_t>> uses;
    for (size_t i = 0; i < nodes_.size(); ++i)
      if (const auto camera = nodes_[i].find_index("camera", cameras.size(), "cameras"))
        if (shown_[i]) uses.emplace_back(*camera, i);
    std::ranges::sort(uses);
    const Box bounds = uses.empty() ? Box{} : scene_bounds(scene_);
    for (const auto& [index, node] : uses) {
      const JsonAt& from = cameras[index];
      Camera camera;
      camera.name = nodes_[node].text("name", from.text("name", from.path()));
      camera.node = places_[node];
      camera.at = {0, 0, -1};
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

 private:
  void import_hierarchy() {
    std::vector<size_t> parents(nodes_.size(), kNone);
    std::vector<std::vector<size_t>> children(nodes_.size());
    for (size_t i = 0; i < nodes_.size(); ++i) {
      for (const JsonAt& member : nodes_[i].list("children")) {
        const size_t child = children[i].emplace_back(member.index(nodes_.size(), "nodes"));
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

  /// Marks the nodes of the scene that is taken; without scenes, all.
  void mark_shown() {
    const std::vector<JsonAt>& scenes = document_.list("scenes");
    shown_.assign(nodes_.size(), scenes.empty());
    if (scenes.empty()) return;
    notes_.count("further scenes in the file left out (--scene)", scenes.size() - 1);
    for (const JsonAt& root : scenes[static_cast<size_t>(scene_.scenes.taken)].list("nodes"))
      shown_[root.index(nodes_.size(), "nodes")] = true;
    for (const size_t i : order_) {
      const int parent = scene_.nodes[static_cast<size_t>(places_[i])].parent;
      if (parent >= 0 && shown_[order_[static_cast<size_t>(parent)]]) shown_[i] = true;
    }
  }

  /// Returns the mesh of a node that is shown.
  [[nodiscard]] std::optional<size_t> shown_mesh(size_t node) const {
    const auto mesh = nodes_[node].find_index("mesh", uses_.size(), "meshes");
    return shown_[node] ? mesh : std::nullopt;
  }

  /// Adds the meshes to the scene, once per instance. Rigid ones that are shown often share their
  /// vertices; those that are shown once are moved.
  void show(size_t node, std::vector<TriangleMesh>& meshes, bool by_several_nodes) {
    const std::vector<int> places = instances(nodes_[node], places_[node]);
    const bool is_shown_often = by_several_nodes || places.size() > 1;
    for (TriangleMesh& from : meshes) {
      // A skin needs a copy of the deformation, with its morph targets.
      const size_t copies = from.deformation ? 1 + from.deformation->targets.size() : 1;
      budget_.take(from.positions.size() * (places.size() + copies - 1),
                   from.triangles.size() * places.size(), nodes_[node]);
      const auto deformation = with_skin(from.deformation, nodes_[node], from.name);
      int shape = -1;
      if (!deformation && is_shown_often) {
        const auto [known, added] = shapes_.try_emplace(&from, std::ssize(scene_.shapes));
        if (added) scene_.shapes.push_back(std::make_shared<const TriangleMesh>(from));
        shape = known->second;
      }
      for (const int place : places) {
        TriangleMesh& shown = scene_.meshes.emplace_back();
        if (shape >= 0) {
          shown.name = from.name;
          shown.material = from.material;
        } else if (is_shown_often) {
          shown = from;
        } else {
          shown = std::move(from);
        }
        shown.shape = shape;
        shown.node = place;
        shown.deformation = deformation;
      }
    }
  }

  /// Returns the nodes that show a node's mesh: the node itself, or one more node for each instance
  /// of EXT_mesh_gpu_instancing.
  [[nodiscard]] std::vector<int> instances(const JsonAt& node, int place) {
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
    read(translations, "VEC3", [](Node& n, const Element& e) { n.translation = vec3(e); });
    read(scales, "VEC3", [](Node& n, const Element& e) { n.scale = vec3(e); });
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

  /// Returns the deformation of a mesh with the skin of a node, if the node has one.
  [[nodiscard]] std::shared_ptr<const Deformation> with_skin(
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

  Document& document_;
  SceneDescription& scene_;
  Notes& notes_;
  const std::vector<JsonAt>& nodes_;
  std::vector<size_t> uses_;                   ///< numbers of shown nodes with each mesh
  std::vector<int> places_;                    ///< indices in the scene
  std::vector<bool> shown_;                    ///< the node belongs to the scene that is shown
  std::vector<size_t> order_;                  ///< parents first
  std::map<const TriangleMesh*, int> shapes_;  ///< indices in the scene
  MeshBudget budget_;
};

// ---- animations

constexpr double kLongestSeconds = 1e7;

enum class Interpolation { Linear, Step, CubicSpline };

Interpolation interpolation_of(const JsonAt& sampler) {
  const std::string name = sampler.text("interpolation", "LINEAR");
  if (name == "LINEAR") return Interpolation::Linear;
  if (name == "STEP") return Interpolation::Step;
  if (name == "CUBICSPLINE") return Interpolation::CubicSpline;
  sampler.at("interpolation").fail("expected LINEAR, STEP or CUBICSPLINE");
}

void assign(Vec3& to, const double* from) { to = {from[0], from[1], from[2]}; }
void assign(std::array<double, 4>& to, const double* from) { std::copy_n(from, 4, to.begin()); }
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
    if (!channel.times.empty())
      return notes_.count("animation channels left out: an earlier one moves the same property");
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

/// Imports the wanted animations of the file, after the meshes.
void import_animations(Document& document, const Nodes& nodes, const std::string& wanted,
                       SceneDescription& scene, Notes& notes) {
  const std::vector<JsonAt>& animations = document.list("animations");
  scene.animations = select(names_of(animations), wanted, "animation", scene.source, 0);
  AnimationImport import(document, scene, notes);
  for (size_t i = 0; i < animations.size(); ++i) {
    if (!scene.animations.takes(i)) continue;
    const std::vector<JsonAt> samplers = animations[i].list("samplers");
    for (const JsonAt& channel : animations[i].list("channels"))
      import.add(channel, samplers, nodes);
  }
  // The nodes of instances come after those of the file.
  for (size_t i = document.list("nodes").size(); i < scene.nodes.size(); ++i)
    scene.nodes[i].morph_weight_keys =
        scene.nodes[static_cast<size_t>(scene.nodes[i].parent)].morph_weight_keys;
}

// ---- loader

constexpr auto kExtensions = std::to_array<std::string_view>(
    {"EXT_mesh_gpu_instancing", "EXT_meshopt_compression", "EXT_texture_webp",
     "KHR_draco_mesh_compression", "KHR_lights_punctual", "KHR_materials_anisotropy",
     "KHR_materials_clearcoat", "KHR_materials_emissive_strength", "KHR_materials_ior",
     "KHR_materials_iridescence", "KHR_materials_pbrSpecularGlossiness", "KHR_materials_sheen",
     "KHR_materials_specular", "KHR_materials_transmission", "KHR_materials_unlit",
     "KHR_materials_variants", "KHR_materials_volume", "KHR_mesh_quantization",
     "KHR_texture_transform"});

/// Metadata; leaving it out changes nothing.
constexpr std::array<std::string_view, 2> kWithoutEffect{"KHR_xmp_json_ld", "KHR_xmp"};

void check_version(const JsonAt& root) {
  const JsonAt version = root.at("asset").at("version");
  const std::string text = version.text();
  if (!text.starts_with("2."))
    version.fail(
        fmt::format("glTF {}, expected 2: 'gltf-pipeline -i OLD.gltf -o NEW.glb' converts it",
                    text.substr(0, 16)));
}

void check_extensions(const JsonAt& root, SceneDescription& scene) {
  for (const JsonAt& name : root.list("extensionsRequired")) {
    if (name.text() == "KHR_texture_basisu")
      throw input_error("{}: {}: KHR_texture_basisu: KTX2 textures are not read", scene.source,
                        name.path())
          .remedy("convert the model: gltf-transform ktxdecompress IN.glb OUT.glb");
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

/// Lists the file's scenes and variants, and sets which of them is shown.
void select_parts(Document& document, const ViewerChoices& wanted, SceneDescription& scene) {
  const std::vector<JsonAt>& scenes = document.list("scenes");
  const size_t stated = document.root().find_index("scene", scenes.size(), "scenes").value_or(0);
  scene.scenes =
      select(names_of(scenes), wanted.scene, "scene", scene.source, static_cast<int>(stated));
  if (const auto variants = document.root().extension("KHR_materials_variants"))
    scene.variants = select(names_of(variants->list("variants")), wanted.variant, "variant",
                            scene.source, Selection::kNone);
}

}  // namespace

}  // namespace lenticule::render::gltf

namespace lenticule::render {

SceneDescription parse_gltf(std::vector<uint8_t> bytes, const std::string& source,
                            const std::optional<std::filesystem::path>& folder,
                            const ViewerChoices& wanted) {
  SceneDescription scene;
  scene.source = source;
  try {
    gltf::Document document(std::move(bytes), source, folder);
    gltf::check_version(document.root());
    gltf::check_extensions(document.root(), scene);
    gltf::select_parts(document, wanted, scene);
    gltf::Notes notes;
    gltf::Nodes nodes(document, scene, notes);
    gltf::Materials materials(document, nodes.used_materials(), scene, notes);
    nodes.import_skins();
    nodes.import_meshes(materials);
    if (scene.meshes.empty()) {
      notes.write(scene);
      refuse_empty(scene);
    }
    gltf::import_animations(document, nodes, wanted.animation, scene, notes);
    nodes.import_lights();
    nodes.import_cameras();
    notes.write(scene);
  } catch (const std::bad_alloc&) {
    throw input_error("{}: needs more memory than is available", source);
  }
  bake_still_nodes(scene);
  expose(scene);
  return scene;
}

}  // namespace lenticule::render
