// SPDX-License-Identifier: Apache-2.0
// Imports nodes and meshes from assimp.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <span>

#include "base/error.h"
#include "frames/srgb.h"
#include "render/loaders/assimp/parts.h"
#include "render/loaders/limits.h"
#include "render/loaders/mesh_cleanup.h"

namespace lenticule::render {
namespace {

[[noreturn]] void refuse(const std::string& source, const std::string& reason) {
  throw Error(ErrorKind::Input, source + ": " + reason);
}

bool usable_coordinate(Vec3 p) {
  return std::abs(p.x) <= kMaxCoordinate && std::abs(p.y) <= kMaxCoordinate &&
         std::abs(p.z) <= kMaxCoordinate;  // false for NaN
}

void check_mesh(const aiMesh& mesh, const std::string& label, const std::string& source) {
  if (mesh.mNumVertices > kMaxVertices)
    refuse(source, fmt::format("{} has more than {} vertices", label, kMaxVertices));
  if (mesh.mNumFaces > kMaxTriangles)
    refuse(source, fmt::format("{} has more than {} faces", label, kMaxTriangles));
  if (mesh.mNumVertices > 0 && mesh.mVertices == nullptr)
    refuse(source, fmt::format("{} has no positions", label));
  for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
    const Vec3 p = vec3(mesh.mVertices[i]);
    if (!is_finite(p)) refuse(source, fmt::format("{} vertex {} is not finite", label, i));
    if (!usable_coordinate(p))
      refuse(source, fmt::format("{} vertex {} is too far away", label, i));
  }
  for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
    const aiFace& face = mesh.mFaces[f];
    for (const unsigned index : std::span(face.mIndices, face.mNumIndices))
      if (index >= mesh.mNumVertices)
        refuse(source, fmt::format("{} face {} refers to vertex {} of {}", label, f, index,
                                   mesh.mNumVertices));
  }
}

std::string label_of(const aiMesh& mesh, unsigned index) {
  const std::string name = mesh.mName.C_Str();
  return name.empty() ? fmt::format("mesh {}", index) : fmt::format("mesh '{}'", name);
}

// ---- nodes

Affine affine_of(const aiMatrix4x4& m) {
  return {Vec3(Vec3f(m.a1, m.b1, m.c1)), Vec3(Vec3f(m.a2, m.b2, m.c2)),
          Vec3(Vec3f(m.a3, m.b3, m.c3)), Vec3(Vec3f(m.a4, m.b4, m.c4))};
}

Node node_of(const aiNode& from, int parent, const std::string& source) {
  Node node;
  node.name = from.mName.C_Str();
  node.parent = parent;
  node.local = affine_of(from.mTransformation);
  const Affine& a = node.local;
  if (!is_finite(a.column_x) || !is_finite(a.column_y) || !is_finite(a.column_z) ||
      !is_finite(a.origin))
    refuse(source, fmt::format("node '{}' has a transform that is not finite", node.name));
  aiVector3D scale;
  aiVector3D translation;
  aiQuaternion rotation;
  from.mTransformation.Decompose(scale, rotation, translation);
  node.scale = vec3(scale);
  node.rotation = {rotation.x, rotation.y, rotation.z, rotation.w};
  node.translation = vec3(translation);
  return node;
}

// ---- meshes

std::vector<Vec3> vectors(const aiVector3D* from, unsigned count) {
  std::vector<Vec3> to;
  to.reserve(count);
  for (const aiVector3D& v : std::span(from, count)) to.push_back(vec3(v));
  return to;
}

/// Returns the set of texture coordinates that the base-colour texture uses, which may not be the
/// first.
unsigned uv_set(const aiMaterial& material) {
  int set = 0;
  if (material.GetTextureCount(aiTextureType_BASE_COLOR) > 0)
    material.Get(AI_MATKEY_UVWSRC(aiTextureType_BASE_COLOR, 0), set);
  else
    material.Get(AI_MATKEY_UVWSRC(aiTextureType_DIFFUSE, 0), set);
  return set >= 0 && set < AI_MAX_NUMBER_OF_TEXTURECOORDS ? static_cast<unsigned>(set) : 0;
}

std::vector<std::array<float, 2>> uvs_of(const aiMesh& mesh, unsigned set) {
  if (!mesh.HasTextureCoords(set)) return {};
  constexpr float kFarthest = 1e6F;
  std::vector<std::array<float, 2>> uvs;
  uvs.reserve(mesh.mNumVertices);
  for (const aiVector3D& uv : std::span(mesh.mTextureCoords[set], mesh.mNumVertices)) {
    const bool usable = std::abs(uv.x) < kFarthest && std::abs(uv.y) < kFarthest;
    uvs.push_back(usable ? std::array{uv.x, uv.y} : std::array{0.0F, 0.0F});
  }
  return uvs;
}

/// Returns the vertex colours, which these formats store as code values.
std::vector<std::array<float, 4>> colours_of(const aiMesh& mesh) {
  std::vector<std::array<float, 4>> colours;
  if (!mesh.HasVertexColors(0)) return colours;
  colours.reserve(mesh.mNumVertices);
  const auto share = [](float v) { return std::isfinite(v) ? std::clamp(v, 0.0F, 1.0F) : 0.0F; };
  const auto light = [&](float v) {
    return static_cast<float>(frames::linear_from_srgb(double{share(v)}));
  };
  for (const aiColor4D& c : std::span(mesh.mColors[0], mesh.mNumVertices))
    colours.push_back({light(c.r), light(c.g), light(c.b), share(c.a)});
  return colours;
}

/// Valid content that the import leaves out.
struct LeftOut {
  bool points_or_lines = false;
  bool skins = false;
  LostDigits digits;
  MeshRepairs repairs;
};

TriangleMesh mesh_of(const aiScene& scene, const aiMesh& from, LeftOut& left_out) {
  TriangleMesh mesh;
  mesh.name = from.mName.C_Str();
  mesh.material = static_cast<int>(from.mMaterialIndex);
  mesh.positions = vectors(from.mVertices, from.mNumVertices);
  if (from.HasNormals()) mesh.normals = vectors(from.mNormals, from.mNumVertices);
  mesh.uvs = uvs_of(from, uv_set(*scene.mMaterials[from.mMaterialIndex]));
  mesh.colours = colours_of(from);
  mesh.triangles.reserve(from.mNumFaces);
  for (const aiFace& face : std::span(from.mFaces, from.mNumFaces))
    if (face.mNumIndices == 3)
      mesh.triangles.push_back({face.mIndices[0], face.mIndices[1], face.mIndices[2]});
  left_out.skins |= from.HasBones() || from.mNumAnimMeshes > 0;
  left_out.digits.add(mesh);
  const MeshRepairs repairs = clean(mesh);
  left_out.repairs.dropped_triangles += repairs.dropped_triangles;
  left_out.repairs.recomputed_normals += repairs.recomputed_normals;
  return mesh;
}

/// ColouredMaterials makes the materials that show vertex colours: white where the file has no
/// texture, since the colours take the place of the material's.
class ColouredMaterials {
 public:
  explicit ColouredMaterials(SceneDescription& scene) : scene_(scene) {}

  int index(int material) {
    const auto [known, added] =
        known_.try_emplace(material, static_cast<int>(scene_.materials.size()));
    if (!added) return known->second;
    Material coloured = scene_.materials[static_cast<size_t>(material)];
    coloured.pbr = std::make_shared<const PbrMaterial>(with_white(coloured));
    scene_.materials.push_back(std::move(coloured));
    return known->second;
  }

 private:
  static PbrMaterial with_white(const Material& material) {
    PbrMaterial pbr;
    if (material.pbr) {
      pbr = *material.pbr;
    } else {
      pbr.metallic = 0.0;
      pbr.double_sided = true;
      pbr.emission = material.emission;
      pbr.base_colour_texture.texture = material.texture;
    }
    pbr.base_colour = {1, 1, 1};
    return pbr;
  }

  SceneDescription& scene_;
  std::map<int, int> known_;
};

/// Converts every mesh once; those without triangles stay empty.
std::vector<TriangleMesh> all_meshes(const aiScene& from, SceneDescription& scene) {
  LeftOut left_out;
  ColouredMaterials coloured(scene);
  std::vector<TriangleMesh> meshes(from.mNumMeshes);
  for (unsigned i = 0; i < from.mNumMeshes; ++i) {
    const aiMesh& mesh = *from.mMeshes[i];
    if (mesh.mMaterialIndex >= from.mNumMaterials)
      refuse(scene.source, fmt::format("{} has no material", label_of(mesh, i)));
    if (mesh.mPrimitiveTypes & aiPrimitiveType_TRIANGLE)
      meshes[i] = mesh_of(from, mesh, left_out);
    else
      left_out.points_or_lines = true;
    TriangleMesh& to = meshes[i];
    if (!to.colours.empty()) to.material = coloured.index(to.material);
    const auto& pbr = scene.materials[static_cast<size_t>(to.material)].pbr;
    if (pbr && pbr->normal_texture.texture >= 0) compute_tangents(to, false);
  }
  const auto note = [&](const std::string& text) { scene.notes.push_back(text); };
  if (const size_t n = left_out.repairs.dropped_triangles)
    note(fmt::format("{} triangles without an area dropped", n));
  if (const size_t n = left_out.repairs.recomputed_normals)
    note(fmt::format("{} unusable normals recomputed", n));
  if (left_out.points_or_lines) note("points and lines left out");
  if (left_out.skins) note("bones and morph targets left out: those meshes keep their rest shape");
  left_out.digits.write(scene);
  return meshes;
}

/// MeshPlacer adds meshes to the scene, once per node that shows them.
class MeshPlacer {
 public:
  MeshPlacer(std::vector<TriangleMesh> meshes, SceneDescription& scene)
      : meshes_(std::move(meshes)), scene_(scene) {}

  void place(const aiNode& from, int node) {
    for (const unsigned index : std::span(from.mMeshes, from.mNumMeshes)) {
      if (index >= meshes_.size())
        refuse(scene_.source, fmt::format("node '{}' refers to mesh {} of {}", from.mName.C_Str(),
                                          index, meshes_.size()));
      const TriangleMesh& mesh = meshes_[index];
      if (mesh.triangles.empty()) continue;
      vertices_ += mesh.positions.size();
      triangles_ += mesh.triangles.size();
      if (vertices_ > kMaxVertices || triangles_ > kMaxTriangles)
        refuse(scene_.source,
               fmt::format("more than {} triangles or {} vertices", kMaxTriangles, kMaxVertices));
      scene_.meshes.push_back(mesh);
      scene_.meshes.back().node = node;
    }
  }

 private:
  std::vector<TriangleMesh> meshes_;
  SceneDescription& scene_;
  size_t vertices_ = 0;
  size_t triangles_ = 0;
};

}  // namespace

void check_meshes(const aiScene& from, const std::string& source) {
  for (unsigned i = 0; i < from.mNumMeshes; ++i)
    check_mesh(*from.mMeshes[i], label_of(*from.mMeshes[i], i), source);
}

NodeNames import_nodes_and_meshes(const aiScene& from, SceneDescription& scene) {
  NodeNames names;
  if (from.mRootNode == nullptr) return names;
  MeshPlacer placer(all_meshes(from, scene), scene);
  // Breadth first: parents come before children, and a deep tree needs no deep stack.
  std::vector<const aiNode*> order{from.mRootNode};
  std::vector<int> parents{-1};
  for (size_t i = 0; i < order.size(); ++i) {
    const aiNode& node = *order[i];
    scene.nodes.push_back(node_of(node, parents[i], scene.source));
    names.try_emplace(scene.nodes.back().name, static_cast<int>(i));
    placer.place(node, static_cast<int>(i));
    for (const aiNode* child : std::span(node.mChildren, node.mNumChildren)) {
      order.push_back(child);
      parents.push_back(static_cast<int>(i));
    }
    if (order.size() > kMaxNodes)
      refuse(scene.source, fmt::format("more than {} nodes", kMaxNodes));
  }
  return names;
}

}  // namespace lenticule::render
