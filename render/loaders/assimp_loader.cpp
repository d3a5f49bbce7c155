// SPDX-License-Identifier: Apache-2.0
#include <assimp/GltfMaterial.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/text.h"
#include "frames/image_io.h"
#include "optics/vec.h"
#include "render/loaders/animation.h"
#include "render/loaders/formats.h"
#include "render/loaders/load_scene.h"
#include "render/loaders/mesh_cleanup.h"
#include "render/loaders/text_reader.h"
#include "render/loaders/textures.h"
#include "render/loaders/viewer_choices.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::render {
namespace {

// Converts assimp's scene to a SceneDescription: nodes and meshes, materials with their textures
// (docs/render/models.md has a table of the conversions), and what refers to nodes by their names:
// key frames, lights and cameras. All values are checked, since assimp's importers pass on
// unchecked file content.

template <class V>
Vec3 vec3(const V& v) {
  return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
}
Vec3 colour_of(const aiColor3D& c) { return Vec3(Vec3f(c.r, c.g, c.b)); }

/// Index of the first node of each name.
using NodeNames = std::unordered_map<std::string, int>;

// ---- checks

std::string label_of(const aiMesh& mesh, unsigned index) {
  const std::string name = mesh.mName.C_Str();
  return name.empty() ? fmt::format("mesh {}", index) : fmt::format("mesh '{}'", name);
}

/// Throws Error(Input) with the mesh and the vertex or face that is invalid.
void check_meshes(const aiScene& from, const std::string& source) {
  for (unsigned m = 0; m < from.mNumMeshes; ++m) {
    const aiMesh& mesh = *from.mMeshes[m];
    const std::string label = label_of(mesh, m);
    if (mesh.mNumVertices > kMaxVertices)
      refuse(source, fmt::format("{} has more than {} vertices", label, kMaxVertices));
    if (mesh.mNumFaces > kMaxTriangles)
      refuse(source, fmt::format("{} has more than {} faces", label, kMaxTriangles));
    if (mesh.mNumVertices > 0 && mesh.mVertices == nullptr)
      refuse(source, fmt::format("{} has no positions", label));
    for (unsigned i = 0; i < mesh.mNumVertices; ++i)
      if (const char* flaw = flaw_of(vec3(mesh.mVertices[i])))
        refuse(source, fmt::format("{} vertex {} is {}", label, i, flaw));
    for (unsigned f = 0; f < mesh.mNumFaces; ++f)
      for (const unsigned index : std::span(mesh.mFaces[f].mIndices, mesh.mFaces[f].mNumIndices))
        if (index >= mesh.mNumVertices)
          refuse(source, fmt::format("{} face {} refers to vertex {} of {}", label, f, index,
                                     mesh.mNumVertices));
  }
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
  std::vector<std::array<float, 2>> uvs;
  uvs.reserve(mesh.mNumVertices);
  for (const aiVector3D& uv : std::span(mesh.mTextureCoords[set], mesh.mNumVertices))
    uvs.push_back(usable_uv(uv.x, uv.y));
  return uvs;
}

/// Returns the vertex colours, which these formats store as code values.
std::vector<std::array<float, 4>> colours_of(const aiMesh& mesh) {
  std::vector<std::array<float, 4>> colours;
  if (!mesh.HasVertexColors(0)) return colours;
  colours.reserve(mesh.mNumVertices);
  for (const aiColor4D& c : std::span(mesh.mColors[0], mesh.mNumVertices))
    colours.push_back(light_of(c.r, c.g, c.b, c.a));
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
  left_out.repairs += clean(mesh);
  return mesh;
}

/// Returns the copy of a material that shows vertex colours: white where the file has no texture,
/// since the colours take the place of the material's. `known` holds the copies made so far.
int coloured(int material, std::map<int, int>& known, SceneDescription& scene) {
  const auto [copy, added] = known.try_emplace(material, static_cast<int>(scene.materials.size()));
  if (!added) return copy->second;
  Material to = scene.materials[static_cast<size_t>(material)];
  PbrMaterial white = to.pbr ? *to.pbr : pbr_like(to);
  white.base_colour = {1, 1, 1};
  to.pbr = std::make_shared<const PbrMaterial>(white);
  scene.materials.push_back(std::move(to));
  return copy->second;
}

/// Converts every mesh once; those without triangles stay empty.
std::vector<TriangleMesh> all_meshes(const aiScene& from, SceneDescription& scene) {
  LeftOut left_out;
  std::map<int, int> copies;
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
    if (!to.colours.empty()) to.material = coloured(to.material, copies, scene);
    const auto& pbr = scene.materials[static_cast<size_t>(to.material)].pbr;
    if (pbr && pbr->normal_texture.texture >= 0) compute_tangents(to, false);
  }
  left_out.repairs.write(scene);
  if (left_out.points_or_lines) scene.notes.emplace_back("points and lines left out");
  if (left_out.skins)
    scene.notes.emplace_back(
        "bones and morph targets left out: those meshes keep their rest shape");
  left_out.digits.write(scene);
  return meshes;
}

/// Imports nodes, parents first, and the meshes attached to them, once per node that shows them.
NodeNames import_nodes_and_meshes(const aiScene& from, SceneDescription& scene) {
  NodeNames names;
  if (from.mRootNode == nullptr) return names;
  const std::vector<TriangleMesh> meshes = all_meshes(from, scene);
  size_t vertices = 0, triangles = 0;
  // Breadth first: parents come before children, and a deep tree needs no deep stack.
  std::vector<const aiNode*> order{from.mRootNode};
  std::vector<int> parents{-1};
  for (size_t i = 0; i < order.size(); ++i) {
    const aiNode& node = *order[i];
    const int number = static_cast<int>(i);
    scene.nodes.push_back(node_of(node, parents[i], scene.source));
    names.try_emplace(scene.nodes.back().name, number);
    for (const unsigned index : std::span(node.mMeshes, node.mNumMeshes)) {
      if (index >= meshes.size())
        refuse(scene.source, fmt::format("node '{}' refers to mesh {} of {}", node.mName.C_Str(),
                                         index, meshes.size()));
      const TriangleMesh& mesh = meshes[index];
      if (mesh.triangles.empty()) continue;
      vertices += mesh.positions.size();
      triangles += mesh.triangles.size();
      if (vertices > kMaxVertices || triangles > kMaxTriangles)
        refuse(scene.source,
               fmt::format("more than {} triangles or {} vertices", kMaxTriangles, kMaxVertices));
      scene.meshes.push_back(mesh);
      scene.meshes.back().node = number;
    }
    order.insert(order.end(), node.mChildren, node.mChildren + node.mNumChildren);
    parents.resize(order.size(), number);
    if (order.size() > kMaxNodes)
      refuse(scene.source, fmt::format("more than {} nodes", kMaxNodes));
  }
  return names;
}

// ---- materials

constexpr double kShiniest = 1e5;
constexpr double kUsualIndex = 1.5;

double luminance(Vec3 c) { return 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z; }

double clamped(double value, double low, double high) {
  return std::isfinite(value) ? std::clamp(value, low, high) : low;
}

/// Returns a property of a material; non-finite values count as absent.
std::optional<double> number(const aiMaterial& from, const char* key, unsigned type,
                             unsigned index) {
  float value = 0.0F;
  if (from.Get(key, type, index, value) != aiReturn_SUCCESS || !std::isfinite(value))
    return std::nullopt;
  return static_cast<double>(value);
}
std::optional<Vec3> colour(const aiMaterial& from, const char* key, unsigned type, unsigned index) {
  aiColor4D value;  // accepts three components as well
  if (from.Get(key, type, index, value) != aiReturn_SUCCESS) return std::nullopt;
  const Vec3 c(Vec3f(value.r, value.g, value.b));
  if (!is_finite(c)) return std::nullopt;
  constexpr Vec3 kBrightest{1e6, 1e6, 1e6};
  return min(max(c, {}), kBrightest);
}

Material material_of(const aiMaterial& from) {
  Material to;
  to.name = from.GetName().C_Str();
  to.colour = colour(from, AI_MATKEY_BASE_COLOR)
                  .value_or(colour(from, AI_MATKEY_COLOR_DIFFUSE).value_or(Vec3{0.8, 0.8, 0.8}));
  // Files state a specular colour for highlights, not for mirrors.
  constexpr double kHighlightOnly = 0.1;
  const double specular = luminance(colour(from, AI_MATKEY_COLOR_SPECULAR).value_or(Vec3{}));
  to.specular = clamped(specular, 0.0, 1.0) * kHighlightOnly;
  to.shine = clamped(number(from, AI_MATKEY_SHININESS).value_or(10.0), 1.0, kShiniest);
  to.emission = colour(from, AI_MATKEY_COLOR_EMISSIVE).value_or(Vec3{}) *
                clamped(number(from, AI_MATKEY_EMISSIVE_INTENSITY).value_or(1.0), 0.0, 1e6);
  to.refraction_index = kUsualIndex;  // for highlights: nothing is seen through the surface
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
                           [&] { return read(name, content, frames::TexelPlace::Anywhere); });
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
                           return rough == metal ? read(rough, kData, frames::TexelPlace::Anywhere)
                                                 : both(rough, metal);
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

  frames::TextureImage read(const std::string& name, frames::TextureContent content,
                            frames::TexelPlace place = frames::TexelPlace::Here) {
    if (const aiTexture* embedded = from_.GetEmbeddedTexture(name.c_str()))
      return read_embedded(*embedded, name, content, place);
    return frames::read_texture(named_file(folder_, name), content, place);
  }

  frames::TextureImage read_embedded(const aiTexture& embedded, const std::string& name,
                                     frames::TextureContent content, frames::TexelPlace place) {
    const std::string label = fmt::format("{}: embedded texture {}", source_, name);
    if (embedded.pcData == nullptr) throw input_error("{}: empty", label);
    if (embedded.mHeight == 0)
      return frames::read_texture(
          std::span(reinterpret_cast<const uint8_t*>(embedded.pcData), embedded.mWidth), label,
          content, place);
    const size_t texels = static_cast<size_t>(embedded.mWidth) * embedded.mHeight;
    if (texels > kMaxTextureBytes / 4) throw input_error("{}: too large", label);
    frames::TextureImage image{
        static_cast<int>(embedded.mWidth), static_cast<int>(embedded.mHeight), {}, {}};
    image.codes.reserve(texels * 4);
    for (const aiTexel& t : std::span(embedded.pcData, texels))
      image.codes.insert(image.codes.end(), {t.r, t.g, t.b, t.a});
    return image;
  }

  /// Returns one texture of both pictures; a missing one counts as white.
  frames::TextureImage both(const std::string& rough, const std::string& metal) {
    const auto picture = [&](const std::string& name) {
      return name.empty() ? white_picture()
                          : frames::floats_of(read(name, frames::TextureContent::Data),
                                              frames::TextureContent::Data);
    };
    return combined(picture(rough), picture(metal), mix_metallic_roughness);
  }

  const aiScene& from_;
  const aiMaterial& material_;
  const std::filesystem::path& folder_;
  const std::string& source_;
  Textures& textures_;
};

// ---- metallic-roughness materials

/// Reads factors and textures; returns false if the file states neither.
bool read_metallic_roughness(const aiMaterial& from, MaterialTextures& textures, PbrMaterial& to) {
  const auto metallic = number(from, AI_MATKEY_METALLIC_FACTOR);
  const auto roughness = number(from, AI_MATKEY_ROUGHNESS_FACTOR);
  const bool metal_texture = textures.has(aiTextureType_METALNESS);
  const bool rough_texture = textures.has(aiTextureType_DIFFUSE_ROUGHNESS);
  if (!metallic && !roughness && !metal_texture && !rough_texture) return false;
  const auto share = [&](const char* key, unsigned type, unsigned index) {
    return clamped(number(from, key, type, index).value_or(0.0), 0.0, 1.0);
  };
  to.metallic = clamped(metallic.value_or(metal_texture ? 1.0 : 0.0), 0.0, 1.0);
  to.roughness = clamped(roughness.value_or(1.0), 0.0, 1.0);
  to.metallic_roughness_texture.texture = textures.find_metallic_roughness();
  to.normal_texture.texture = textures.find({aiTextureType_NORMALS}, frames::TextureContent::Data);
  to.emission_texture.texture = textures.find(
      {aiTextureType_EMISSION_COLOR, aiTextureType_EMISSIVE}, frames::TextureContent::Colour);
  // A file with a texture and no colour, or black, means the texture.
  if (to.emission_texture.texture >= 0 && to.emission == Vec3{}) to.emission = {1, 1, 1};
  to.transmission = share(AI_MATKEY_TRANSMISSION_FACTOR);
  to.thickness = 0.0;
  to.specular = 1.0;
  to.ior = clamped(number(from, AI_MATKEY_REFRACTI).value_or(kUsualIndex), 1.0, 100.0);
  to.clearcoat = share(AI_MATKEY_CLEARCOAT_FACTOR);
  to.clearcoat_roughness = share(AI_MATKEY_CLEARCOAT_ROUGHNESS_FACTOR);
  to.sheen_colour = colour(from, AI_MATKEY_SHEEN_COLOR_FACTOR).value_or(Vec3{});
  return true;
}

/// Imports materials, and the textures of those that a mesh uses. Relative file names start at the
/// folder of `file`.
void import_materials(const aiScene& from, const std::filesystem::path& file,
                      SceneDescription& scene) {
  const std::filesystem::path folder = file.parent_path();
  // A texture takes the place of the diffuse colour in the programs that write these formats.
  const bool replaces = is_one_of(" .fbx .3ds ", lower_case(file.extension().string()));
  if (from.mNumMaterials > kMaxMaterials)
    refuse(scene.source, fmt::format("more than {} materials", kMaxMaterials));
  std::vector<bool> used(from.mNumMaterials);
  for (const aiMesh* mesh : std::span(from.mMeshes, from.mNumMeshes))
    if ((mesh->mPrimitiveTypes & aiPrimitiveType_TRIANGLE) && mesh->mMaterialIndex < used.size())
      used[mesh->mMaterialIndex] = true;
  Textures all(scene);
  for (const aiMaterial* material : std::span(from.mMaterials, from.mNumMaterials)) {
    Material& to = scene.materials.emplace_back(material_of(*material));
    if (!used[scene.materials.size() - 1]) continue;
    MaterialTextures textures(from, *material, folder, scene.source, all);
    to.texture = textures.find({aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE},
                               frames::TextureContent::Colour);
    if (replaces && to.texture >= 0) to.colour = {1, 1, 1};
    PbrMaterial pbr = pbr_like(to);
    const bool is_stated = read_metallic_roughness(*material, textures, pbr);
    pbr.alpha = clamped(number(*material, AI_MATKEY_OPACITY).value_or(1.0), 0.0, 1.0);
    // Exporters of 3ds Max and Blender wrote a transparency of 0 for surfaces that hide all.
    if (pbr.alpha == 0.0) pbr.alpha = 1.0;
    if (pbr.alpha < 1.0) pbr.alpha_mode = PbrMaterial::AlphaMode::Blend;
    if (is_stated || pbr.alpha < 1.0) to.pbr = std::make_shared<const PbrMaterial>(pbr);
  }
}

// ---- animation

constexpr double kTicksPerSecondUnlessStated = 25.0;
constexpr double kLongestSeconds = 1e7;

Vec3 value_of(const aiVectorKey& key) { return vec3(key.mValue); }
std::array<double, 4> value_of(const aiQuatKey& key) {
  return {key.mValue.x, key.mValue.y, key.mValue.z, key.mValue.w};
}

bool is_finite(const std::array<double, 4>& q) {
  return std::ranges::all_of(q, [](double v) { return std::isfinite(v); });
}

/// Imports the key frames of the wanted animations; a node that an earlier channel moves stays as
/// it is.
void import_animations(const aiScene& from, const NodeNames& nodes, const std::string& wanted,
                       SceneDescription& scene) {
  const std::span animations(from.mAnimations, from.mNumAnimations);
  std::vector<std::string> names;
  for (const aiAnimation* one : animations) names.emplace_back(one->mName.C_Str());
  scene.animations = select(names, wanted, "animation", scene.source, 0);
  size_t all = 0, dropped = 0;
  const auto read = [&](const auto& keys, double ticks_per_second, Node& node, auto& channel) {
    if ((all += keys.size()) > kMaxKeys)
      refuse(scene.source, fmt::format("more than {} key frames", kMaxKeys));
    for (const auto& key : keys) {
      const double seconds = key.mTime / ticks_per_second;
      const auto value = value_of(key);
      if (!(std::abs(seconds) <= kLongestSeconds) || !is_finite(value))
        refuse(scene.source,
               fmt::format("node '{}' has a key frame that is not finite", node.name));
      if (!channel.times.empty() && seconds <= channel.times.back()) {
        ++dropped;
        continue;
      }
      channel.times.push_back(seconds);
      channel.values.push_back(value);
      scene.duration_seconds = std::max(scene.duration_seconds, seconds);
      node.animated = true;
    }
  };
  for (size_t n = 0; n < names.size(); ++n) {
    if (!scene.animations.takes(n)) continue;
    const double stated = animations[n]->mTicksPerSecond;
    const double ticks_per_second =
        std::isfinite(stated) && stated > 0.0 ? stated : kTicksPerSecondUnlessStated;
    for (const aiNodeAnim* moves :
         std::span(animations[n]->mChannels, animations[n]->mNumChannels)) {
      const auto found = nodes.find(moves->mNodeName.C_Str());
      if (found == nodes.end()) continue;
      Node& node = scene.nodes[static_cast<size_t>(found->second)];
      if (node.animated) continue;
      read(std::span(moves->mPositionKeys, moves->mNumPositionKeys), ticks_per_second, node,
           node.translations);
      read(std::span(moves->mRotationKeys, moves->mNumRotationKeys), ticks_per_second, node,
           node.rotations);
      read(std::span(moves->mScalingKeys, moves->mNumScalingKeys), ticks_per_second, node,
           node.scales);
    }
  }
  if (dropped > 0)
    scene.notes.push_back(fmt::format("{} key frames out of order dropped", dropped));
}

// ---- lights

double cosine(double angle) {
  constexpr double kWidest = std::numbers::pi / 2.0;
  return std::isfinite(angle) ? std::cos(std::clamp(angle, 0.0, kWidest)) : 0.0;
}

Light light_of(const aiLight& from) {
  Light light;
  light.kind = from.mType == aiLightSource_DIRECTIONAL ? Light::Kind::Directional
               : from.mType == aiLightSource_SPOT      ? Light::Kind::Spot
                                                       : Light::Kind::Point;
  light.position = vec3(from.mPosition);
  light.direction = normalized(vec3(from.mDirection));
  light.colour = colour_of(from.mColorDiffuse);
  light.falls_off = light.kind != Light::Kind::Directional && from.mAttenuationQuadratic > 0.0F;
  constexpr double kHalf = 0.5;  // the importers state full angles
  light.cos_inner = cosine(from.mAngleInnerCone * kHalf);
  light.cos_outer = std::min(cosine(from.mAngleOuterCone * kHalf), light.cos_inner);
  return light;
}

bool usable(const Light& light) {
  const double strength = light.colour.x + light.colour.y + light.colour.z;
  const bool aimed =
      light.kind == Light::Kind::Point || std::abs(length(light.direction) - 1.0) < 1e-6;
  return is_finite(light.colour) && strength > 0.0 && is_finite(light.position) && aimed;
}

void import_lights(const aiScene& from, const NodeNames& nodes, SceneDescription& scene) {
  size_t unusable = 0;
  for (const aiLight* light : std::span(from.mLights, from.mNumLights)) {
    if (light->mType == aiLightSource_AMBIENT) {
      scene.ambient = scene.ambient.value_or(Vec3{}) + colour_of(light->mColorAmbient);
      continue;
    }
    if (scene.lights.size() == kMaxLights)
      refuse(scene.source, fmt::format("more than {} lights", kMaxLights));
    Light to = light_of(*light);
    if (!usable(to)) {
      ++unusable;
      continue;
    }
    const auto node = nodes.find(light->mName.C_Str());
    to.node = node == nodes.end() ? -1 : node->second;
    scene.lights.push_back(to);
  }
  if (unusable > 0) scene.notes.push_back(fmt::format("{} unusable lights left out", unusable));
  if (scene.ambient && !is_finite(*scene.ambient)) scene.ambient.reset();
}

// ---- cameras

/// Returns the vertical angle; assimp states the horizontal angle.
double vertical_fov_degrees(const aiCamera& from) {
  const double aspect = from.mAspect > 0.0F ? from.mAspect : 1.0;
  const double vertical = 2.0 * std::atan(std::tan(from.mHorizontalFOV / 2.0) / aspect);
  return vertical * 180.0 / std::numbers::pi;
}

/// Converts a camera; it looks at a point at distance 1 until focus() moves that point.
Camera camera_of(const aiCamera& from) {
  Camera camera;
  camera.name = from.mName.C_Str();
  camera.from = vec3(from.mPosition);
  camera.at = camera.from + normalized(vec3(from.mLookAt));
  camera.up = vec3(from.mUp);
  camera.vertical_fov_degrees = vertical_fov_degrees(from);
  camera.hither = std::isfinite(from.mClipPlaneNear) ? std::max(0.0F, from.mClipPlaneNear) : 0.0F;
  return camera;
}

/// Imports cameras. Requires the meshes to be in place: a file states the direction in which a
/// camera looks, but not the distance.
void import_cameras(const aiScene& from, const NodeNames& nodes, SceneDescription& scene) {
  if (from.mNumCameras == 0) return;
  const Box bounds = scene_bounds(scene);
  size_t unusable = 0;
  for (const aiCamera* camera : std::span(from.mCameras, from.mNumCameras)) {
    Camera to = camera_of(*camera);
    const auto node = nodes.find(to.name);
    to.node = node == nodes.end() ? -1 : node->second;
    if (!is_usable(to) || bounds.empty()) {
      ++unusable;
      continue;
    }
    if (camera->mOrthographicWidth > 0.0F && scene.cameras.empty())
      scene.notes.emplace_back("orthographic camera treated as a perspective one");
    focus(to, scene, bounds);
    scene.cameras.push_back(to);
  }
  if (unusable > 0) scene.notes.push_back(fmt::format("{} unusable cameras left out", unusable));
}

SceneDescription import_scene(const aiScene& from, const std::filesystem::path& file,
                              const ViewerChoices& wanted) {
  SceneDescription scene;
  scene.source = file.string();
  import_materials(from, file, scene);
  const NodeNames nodes = import_nodes_and_meshes(from, scene);
  if (scene.meshes.empty()) refuse_empty(scene);
  import_animations(from, nodes, wanted.animation, scene);
  import_lights(from, nodes, scene);
  import_cameras(from, nodes, scene);
  // The importer of FBX states this axis; some versions of assimp turn the root as well.
  if (int32_t up = 1; from.mMetaData != nullptr && from.mMetaData->Get("UpAxis", up) && up == 2 &&
                      from.mRootNode->mTransformation.IsIdentity())
    turn_upright(scene, UpAxis::Z);
  bake_still_nodes(scene);
  expose(scene);
  return scene;
}

// ---- guarded files

class BytesStream : public Assimp::IOStream {
 public:
  explicit BytesStream(std::vector<uint8_t> bytes) : bytes_(std::move(bytes)) {}

  size_t Read(void* buffer, size_t size, size_t count) override {
    if (size == 0) return 0;
    const size_t whole = std::min(count, (bytes_.size() - position_) / size);
    if (whole == 0) return 0;  // memcpy must not get the null pointer of an empty file
    std::memcpy(buffer, bytes_.data() + position_, whole * size);
    position_ += whole * size;
    return whole;
  }

  aiReturn Seek(size_t offset, aiOrigin origin) override {
    // A negative offset from aiOrigin_CUR or aiOrigin_END arrives as its two's complement, so the
    // wrapped sum is the intended position.
    const size_t base = origin == aiOrigin_SET   ? 0
                        : origin == aiOrigin_CUR ? position_
                                                 : bytes_.size();
    const size_t place = base + offset;
    if (place > bytes_.size()) return aiReturn_FAILURE;
    position_ = place;
    return aiReturn_SUCCESS;
  }

  size_t Write(const void*, size_t, size_t) override { return 0; }
  size_t Tell() const override { return position_; }
  size_t FileSize() const override { return bytes_.size(); }
  void Flush() override {}

 private:
  std::vector<uint8_t> bytes_;
  size_t position_ = 0;
};

std::filesystem::path found(const std::filesystem::path& file) {
  return named_file(file.parent_path(), file.filename().string());
}

/// GuardedFiles restricts the files that assimp may open to regular files of limited size,
/// read-only. Each is read completely before assimp gets it, so that a scene can name neither an
/// endless pipe nor a device, and cannot cause writes. Finds files whose names differ in the
/// case of letters only.
class GuardedFiles : public Assimp::IOSystem {
 public:
  bool Exists(const char* file) const override {
    kept_ = contents(file);
    kept_name_ = file;
    return kept_.has_value();
  }

  char getOsSeparator() const override { return '/'; }

  Assimp::IOStream* Open(const char* file, const char* mode) override {
    if (std::string_view(mode).find_first_of("wa+") != std::string_view::npos) return nullptr;
    // Assimp opens what it found.
    auto bytes = kept_name_ == file ? std::exchange(kept_, std::nullopt) : contents(file);
    kept_name_.clear();
    if (!bytes) return nullptr;
    return std::make_unique<BytesStream>(*std::move(bytes)).release();
  }

  void Close(Assimp::IOStream* stream) override {
    const std::unique_ptr<Assimp::IOStream> closed(stream);
  }

 private:
  /// Returns none for a file that cannot be read.
  [[nodiscard]] std::optional<std::vector<uint8_t>> contents(const char* file) const {
    try {
      return read_scene_file(found(file));
    } catch (const Error&) {
      return std::nullopt;
    }
  }

  mutable std::string kept_name_;  ///< file whose bytes are in kept_
  mutable std::optional<std::vector<uint8_t>> kept_;
};

// ---- loader

/// Shortens assimp's messages, which are meant for programmers: first line only, printable, limited
/// length.
std::string tidy(const std::string& message) {
  constexpr size_t kLongest = 160;
  if (message.find("bad_alloc") != std::string::npos)
    return "needs more memory than a model of its size may take";
  if (message.starts_with("No suitable reader"))
    return "not in the format of its extension, or damaged or truncated";
  std::string out;
  for (const char c : message.substr(0, std::min(message.find('\n'), kLongest)))
    out += c >= ' ' && c < 127 ? c : '?';
  while (out.ends_with('.')) out.pop_back();
  return out.empty() ? "cannot be parsed" : out;
}

/// Reads the file. The data is checked before assimp's own post-processing runs, which trusts the
/// data.
const aiScene& read(Assimp::Importer& importer, const std::filesystem::path& file) {
  importer.SetIOHandler(std::make_unique<GuardedFiles>().release());  // the importer deletes it
  importer.SetPropertyBool("IMPORT_NO_SKELETON_MESHES", true);
  const aiScene* scene = importer.ReadFile(file.string(), 0);
  if (scene == nullptr) refuse(file, tidy(importer.GetErrorString()));
  if (scene->mNumMeshes == 0) refuse_empty({.source = file.string()});
  check_meshes(*scene, file.string());
  // Not aiProcess_JoinIdenticalVertices, which merges vertices within 1e-5 units and so collapses a
  // small scene to a point.
  scene = importer.ApplyPostProcessing(aiProcess_Triangulate | aiProcess_SortByPType |
                                       aiProcess_FlipUVs);
  if (scene == nullptr) refuse(file, tidy(importer.GetErrorString()));
  check_meshes(*scene, file.string());
  return *scene;
}

}  // namespace

bool assimp_reads(const std::string& extension) {
  return !extension.empty() && Assimp::Importer().IsExtensionSupported(extension);
}

SceneDescription load_with_assimp(const std::filesystem::path& file, const ViewerChoices& wanted) {
  try {
    Assimp::Importer importer;
    return import_scene(read(importer, file), file, wanted);
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    refuse(file, tidy("bad_alloc"));
  } catch (const std::exception& failure) {
    refuse(file, tidy(failure.what()));
  }
}

}  // namespace lenticule::render
