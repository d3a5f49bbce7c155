// SPDX-License-Identifier: Apache-2.0
// A primitive is a list of triangles of one material. Its vertex attributes come from accessors or
// from Draco data; strips and fans become triangles, tangents are computed where a material needs
// them, and morph targets and the weights of joints are kept for the animation.
#include "render/loaders/gltf/primitives.h"

// The headers of the library convert between integers of different size.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wpedantic"
#include <draco/compression/decode.h>
#pragma GCC diagnostic pop

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numeric>
#include <optional>

#include "render/loaders/limits.h"
#include "render/scene/stage.h"

namespace lenticule::render::gltf {
namespace {

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
        for (double& value : element) value = normalized_value(value, accessor.component());
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

bool usable_coordinate(double value) {
  return std::abs(value) <= kMaxCoordinate;  // false for NaN
}

Vec3 vec3(const Element& e) {
  return {e[0], e[1], e[2]};
}

std::vector<Vec3> positions_of(const Attributes& attributes, size_t count,
                               const std::string& name) {
  std::vector<Vec3> positions(count);
  attributes.each("POSITION", "VEC3", count, [&](size_t i, const Element& e) {
    positions[i] = vec3(e);
    if (usable_coordinate(e[0]) && usable_coordinate(e[1]) && usable_coordinate(e[2])) return;
    attributes.at("POSITION")
        .fail(fmt::format("mesh '{}' vertex {} is {}", name, i,
                          is_finite(vec3(e)) ? "too far away" : "not finite"));
  });
  return positions;
}

std::vector<Vec3> normals_of(const Attributes& attributes, size_t count) {
  std::vector<Vec3> normals;
  if (!attributes.has("NORMAL")) return normals;
  normals.resize(count);
  attributes.each("NORMAL", "VEC3", count,
                  [&](size_t i, const Element& e) { normals[i] = vec3(e); });
  return normals;
}

std::vector<std::array<float, 2>> uvs_of(const Attributes& attributes, size_t count, uint64_t set) {
  std::vector<std::array<float, 2>> uvs;
  const std::string name = fmt::format("TEXCOORD_{}", set);
  if (!attributes.has(name)) return uvs;
  uvs.resize(count);
  constexpr double kFarthest = 1e6;
  attributes.each(name, "VEC2", count, [&](size_t i, const Element& e) {
    const bool usable = std::abs(e[0]) < kFarthest && std::abs(e[1]) < kFarthest;
    uvs[i] = usable ? std::array{static_cast<float>(e[0]), static_cast<float>(e[1])}
                    : std::array{0.0F, 0.0F};
  });
  return uvs;
}

std::vector<std::array<float, 4>> colours_of(const Attributes& attributes, size_t count) {
  std::vector<std::array<float, 4>> colours;
  if (!attributes.has("COLOR_0")) return colours;
  const bool with_alpha = attributes.accessor("COLOR_0").components() == 4;
  colours.resize(count);
  const auto share = [](double v) {
    return static_cast<float>(std::isfinite(v) ? std::clamp(v, 0.0, 1.0) : 0.0);
  };
  attributes.each("COLOR_0", with_alpha ? "VEC4" : "VEC3", count, [&](size_t i, const Element& e) {
    colours[i] = {share(e[0]), share(e[1]), share(e[2]), with_alpha ? share(e[3]) : 1.0F};
  });
  return colours;
}

/// Reads tangents and makes them unit vectors. They belong to normals and mean nothing without.
std::vector<std::array<float, 4>> tangents_of(const Attributes& attributes, size_t count,
                                              const std::vector<Vec3>& normals) {
  std::vector<std::array<float, 4>> tangents;
  if (normals.empty() || !attributes.has("TANGENT")) return tangents;
  tangents.resize(count);
  attributes.each("TANGENT", "VEC4", count, [&](size_t i, const Element& e) {
    Vec3 direction = normalized(vec3(e));
    if (!(length(direction) > 0.5) || !is_finite(direction))
      direction = is_finite(normals[i]) && !(normals[i] == Vec3{})
                      ? any_perpendicular(normalized(normals[i]))
                      : Vec3{1, 0, 0};
    const Vec3f unit(direction);
    tangents[i] = {unit.x, unit.y, unit.z, e[3] < 0.0 ? -1.0F : 1.0F};
  });
  return tangents;
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
    const Component c = accessor.component();
    if (c != Component::Uint8 && c != Component::Uint16 && c != Component::Uint32)
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
    if (!usable_coordinate(e[0]) || !usable_coordinate(e[1]) || !usable_coordinate(e[2]))
      member->fail(fmt::format("vertex {} is not finite or too far away", i));
    offsets[i] = Vec3f(vec3(e));
  });
  return offsets;
}

}  // namespace

void MeshBudget::take(size_t vertices, size_t triangles, const JsonAt& where) {
  vertices_ += vertices;
  triangles_ += triangles;
  if (vertices_ > kMaxVertices || triangles_ > kMaxTriangles)
    where.fail(fmt::format("more than {} triangles or {} vertices in the scene", kMaxTriangles,
                           kMaxVertices));
}

TriangleMesh Primitives::read(const JsonAt& primitive, const std::string& name) {
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

  mesh.material = materials_.index(
      primitive.find_index("material", document_.list("materials").size(), "materials"));
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
    // The deformation may give a triangle an area, so all stay. Each frame's mesh is cleaned later.
    for (Vec3& normal : mesh.normals) normal = normalized(is_finite(normal) ? normal : Vec3{});
    mesh.deformation = std::move(deformation);
  } else {
    const MeshRepairs repairs = clean(mesh);
    repairs_.dropped_triangles += repairs.dropped_triangles;
    repairs_.recomputed_normals += repairs.recomputed_normals;
  }
  if (mesh.tangents.empty() && input.tangent_uvs) compute_tangents(mesh, *input.tangent_uvs == 1);
  return mesh;
}

const std::vector<TriangleMesh>& Primitives::of_mesh(size_t index) {
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

size_t Primitives::targets(size_t index) {
  const JsonAt primitives = document_.list("meshes")[index].at("primitives");
  return primitives.size() == 0 ? 0 : primitives[0].list("targets").size();
}

void Primitives::note_repairs(SceneDescription& scene) const {
  notes_.count("triangles without an area dropped", repairs_.dropped_triangles);
  notes_.count("unusable normals recomputed", repairs_.recomputed_normals);
  digits_.write(scene);
}

}  // namespace lenticule::render::gltf
