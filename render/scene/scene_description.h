// SPDX-License-Identifier: Apache-2.0
// Scene description as loaders build it: plain data, world coordinates, double precision. The
// renderer commits it to Embree as a render::Scene (render/scene/scene.h).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "optics/vec.h"

namespace lenticule::render {

/// Texture holds the texels of a picture, rows from the top: either `codes` or `rgba`, four
/// channels each.
struct Texture {
  int width = 0;
  int height = 0;
  std::vector<float> rgba{};  ///< linear light, or the values of a float file
  /// 8-bit values as the file has them. Where the texture is a colour, RGB is sRGB-encoded.
  std::vector<uint8_t> codes{};
  /// Number of the texels in another process that holds them; -1: they are here.
  int held = -1;
  bool repeat_u = true;
  bool repeat_v = true;
  bool mirror_u = false;  ///< every second repetition is mirrored; requires repeat_u
  bool mirror_v = false;
  std::string name{};
};

/// TextureUse binds a texture to one input of a material.
struct TextureUse {
  int texture = -1;  ///< index into SceneDescription::textures, or -1
  int uv_set = 0;    ///< 0: TriangleMesh::uvs, 1: TriangleMesh::uvs2
  /// Rows of the map from the mesh's coordinates (u, v, 1) to the texture's.
  std::array<double, 6> uv_map{1, 0, 0, 0, 1, 0};
};

/// PbrMaterial is the metallic-roughness material of glTF 2.0 with its ratified extensions. Names,
/// units and defaults are glTF's; colours are linear light. A texture multiplies the factor beside
/// it, in the channels that glTF states.
struct PbrMaterial {
  Vec3 base_colour{1, 1, 1};
  double alpha = 1.0;
  TextureUse base_colour_texture{};  ///< RGB and alpha
  double metallic = 1.0;
  double roughness = 1.0;
  TextureUse metallic_roughness_texture{};  ///< G: roughness, B: metallic
  TextureUse normal_texture{};
  double normal_scale = 1.0;
  TextureUse occlusion_texture{};  ///< R
  double occlusion_strength = 1.0;
  Vec3 emission{0, 0, 0};  ///< with emissive_strength
  TextureUse emission_texture{};
  enum class AlphaMode { Opaque, Mask, Blend } alpha_mode = AlphaMode::Opaque;
  double alpha_cutoff = 0.5;
  bool double_sided = false;
  bool unlit = false;
  double ior = 1.5;
  double specular = 1.0;
  Vec3 specular_colour{1, 1, 1};
  TextureUse specular_texture{};  ///< A
  TextureUse specular_colour_texture{};
  double clearcoat = 0.0;
  double clearcoat_roughness = 0.0;
  TextureUse clearcoat_texture{};            ///< R
  TextureUse clearcoat_roughness_texture{};  ///< G
  TextureUse clearcoat_normal_texture{};
  Vec3 sheen_colour{0, 0, 0};
  double sheen_roughness = 0.0;
  TextureUse sheen_colour_texture{};
  TextureUse sheen_roughness_texture{};  ///< A
  double transmission = 0.0;
  TextureUse transmission_texture{};  ///< R
  double thickness = 0.0;             ///< world units; 0: the surface is thin
  TextureUse thickness_texture{};     ///< G
  double attenuation_distance = std::numeric_limits<double>::infinity();  ///< world units
  Vec3 attenuation_colour{1, 1, 1};
  double iridescence = 0.0;
  double iridescence_ior = 1.3;
  double iridescence_thickness_min = 100.0;  ///< nanometres
  double iridescence_thickness_max = 400.0;
  TextureUse iridescence_texture{};            ///< R
  TextureUse iridescence_thickness_texture{};  ///< G
  double anisotropy = 0.0;
  double anisotropy_rotation = 0.0;  ///< radians
  TextureUse anisotropy_texture{};   ///< RG: direction, B: strength
};

// All numbers, colours and textures of a PbrMaterial, for what treats them alike: the fingerprint
// and the check of committed materials. A new member needs an entry.
inline constexpr double PbrMaterial::*kPbrNumbers[] = {&PbrMaterial::alpha,
                                                       &PbrMaterial::metallic,
                                                       &PbrMaterial::roughness,
                                                       &PbrMaterial::normal_scale,
                                                       &PbrMaterial::occlusion_strength,
                                                       &PbrMaterial::alpha_cutoff,
                                                       &PbrMaterial::ior,
                                                       &PbrMaterial::specular,
                                                       &PbrMaterial::clearcoat,
                                                       &PbrMaterial::clearcoat_roughness,
                                                       &PbrMaterial::sheen_roughness,
                                                       &PbrMaterial::transmission,
                                                       &PbrMaterial::thickness,
                                                       &PbrMaterial::attenuation_distance,
                                                       &PbrMaterial::iridescence,
                                                       &PbrMaterial::iridescence_ior,
                                                       &PbrMaterial::iridescence_thickness_min,
                                                       &PbrMaterial::iridescence_thickness_max,
                                                       &PbrMaterial::anisotropy,
                                                       &PbrMaterial::anisotropy_rotation};
inline constexpr Vec3 PbrMaterial::*kPbrColours[] = {
    &PbrMaterial::base_colour, &PbrMaterial::emission, &PbrMaterial::specular_colour,
    &PbrMaterial::sheen_colour, &PbrMaterial::attenuation_colour};
inline constexpr auto kPbrTextures = std::to_array<TextureUse PbrMaterial::*>(
    {&PbrMaterial::base_colour_texture, &PbrMaterial::metallic_roughness_texture,
     &PbrMaterial::normal_texture, &PbrMaterial::occlusion_texture, &PbrMaterial::emission_texture,
     &PbrMaterial::specular_texture, &PbrMaterial::specular_colour_texture,
     &PbrMaterial::clearcoat_texture, &PbrMaterial::clearcoat_roughness_texture,
     &PbrMaterial::clearcoat_normal_texture, &PbrMaterial::sheen_colour_texture,
     &PbrMaterial::sheen_roughness_texture, &PbrMaterial::transmission_texture,
     &PbrMaterial::thickness_texture, &PbrMaterial::iridescence_texture,
     &PbrMaterial::iridescence_thickness_texture, &PbrMaterial::anisotropy_texture});

/// Whitted material. Colours are linear light in colour-managed formats (such as glTF) and code
/// values in NFF; see SceneDescription::colour_managed.
struct Material {
  std::string name{};
  Vec3 colour{1, 1, 1};        ///< diffuse and transmitted colour
  double diffuse = 1.0;        ///< Kd
  double specular = 0.0;       ///< Ks: mirror and highlight weight
  double shine = 1.0;          ///< Phong exponent of the highlight
  double transmittance = 0.0;  ///< T
  double refraction_index = 1.0;
  Vec3 emission{0, 0, 0};
  /// If true, highlights are tinted with `colour` (metals); if false, highlights are white
  /// (plastic, NFF).
  bool tinted_specular = false;
  bool two_sided = true;
  int texture = -1;  ///< index of the base colour texture, which multiplies `colour`, or -1
  /// If set, the surface is shaded by this model instead of Whitted's, and all members above except
  /// `name` are ignored.
  std::shared_ptr<const PbrMaterial> pbr{};
};

/// Skin lists the nodes that move the vertices of a mesh.
struct Skin {
  std::vector<int> joints{};              ///< indices into SceneDescription::nodes
  std::vector<Affine> joint_from_mesh{};  ///< per joint (inverse bind matrix)
};

/// MorphTarget holds what a weight of 1 adds to each vertex; an empty list adds nothing.
struct MorphTarget {
  std::vector<Vec3f> positions{};
  std::vector<Vec3f> normals{};
  std::vector<Vec3f> tangents{};
};

/// Deformation makes the shape of a mesh depend on the time: first morph targets, with the weights
/// of the mesh's node, then the skin.
struct Deformation {
  std::vector<MorphTarget> targets{};
  int skin = -1;  ///< index into SceneDescription::skins, or -1
  size_t joints_per_vertex = 0;
  std::vector<uint16_t> joints{};  ///< indices into Skin::joints, joints_per_vertex of each vertex
  std::vector<float> weights{};    ///< weight of each joint; their sum is 1 for each vertex
};

struct TriangleMesh {
  std::string name{};
  int material = 0;
  std::vector<Vec3> positions{};
  std::vector<std::array<uint32_t, 3>> triangles{};
  std::vector<Vec3> normals{};  ///< per vertex, unit, or empty
  std::vector<std::array<float, 2>>
      uvs{};  ///< per vertex, v = 0 at the top of the texture, or empty
  std::vector<std::array<float, 2>> uvs2{};     ///< second set, for PbrMaterial, or empty
  std::vector<std::array<float, 4>> colours{};  ///< linear RGBA per vertex, or empty
  /// Unit tangents per vertex; the fourth component is the sign of the bitangent. Or empty.
  std::vector<std::array<float, 4>> tangents{};
  /// Index into SceneDescription::nodes of the node that moves this mesh, or -1 if the mesh is
  /// static.
  int node = -1;
  /// Null for a rigid mesh. A mesh with a skin follows its joints instead of its node.
  std::shared_ptr<const Deformation> deformation{};
  /// Index into SceneDescription::shapes of the mesh whose vertices and triangles this one has,
  /// moved by `place`; -1: its own.
  int shape = -1;
  Affine place{};
};

struct Sphere {
  Vec3 centre{};
  double radius = 1.0;  ///< > 0
  bool inward = false;  ///< the inside is the visible side (negative radius in NFF)
  int material = 0;
};

/// Cone is an open cone or cylinder between two discs.
struct Cone {
  Vec3 base{};
  double base_radius = 1.0;
  Vec3 apex{};
  double apex_radius = 0.0;
  bool inward = false;
  int material = 0;
};

struct Light {
  enum class Kind { Point, Directional, Spot } kind = Kind::Point;
  Vec3 position{};           ///< point, spot
  Vec3 direction{0, 0, -1};  ///< directional, spot: unit direction in which the light travels
  Vec3 colour{1, 1, 1};      ///< intensity; for colour-managed files radiometric up to a scale
  bool falls_off = false;    ///< inverse square (glTF) or constant (NFF)
  double cos_inner = 1.0;    ///< spot
  double cos_outer = 0.0;    ///< spot
  int node = -1;
};

struct Camera {
  std::string name{};
  Vec3 from{};
  Vec3 at{};
  Vec3 up{0, 1, 0};
  double vertical_fov_degrees = 45.0;
  double hither = 0.0;
  int node = -1;
};

/// Channel is a key-framed transform component. Times are in seconds, ascending; an empty channel
/// is constant.
template <class T>
struct Channel {
  std::vector<double> times{};
  std::vector<T> values{};
  bool steps = false;  ///< each key holds until the next one, without interpolation
  /// Derivatives before and after each key of a cubic Hermite spline, or empty.
  std::vector<T> in_tangents{};
  std::vector<T> out_tangents{};
};

struct Node {
  std::string name{};
  int parent = -1;
  Affine local{};  ///< used by components that no channel overrides
  Vec3 scale{1, 1, 1};
  std::array<double, 4> rotation{0, 0, 0, 1};  ///< quaternion x, y, z, w
  Vec3 translation{0, 0, 0};
  bool animated = false;  ///< one of the three channels has keys
  Channel<Vec3> translations{};
  Channel<std::array<double, 4>> rotations{};
  Channel<Vec3> scales{};
  std::vector<double> morph_weights{};  ///< weights of the morph targets of the node's meshes
  Channel<std::vector<double>> morph_weight_keys{};
};

/// Selection lists what a file has of one kind, and what of that the scene consists of.
struct Selection {
  static constexpr int kNone = -1, kAll = -2;
  std::vector<std::string> names{};  ///< names in the order of the file; some may be empty
  int taken = kNone;                 ///< index into names, or kNone or kAll

  [[nodiscard]] bool takes(size_t n) const { return taken == kAll || taken == static_cast<int>(n); }
};

struct SceneDescription {
  std::string source{};  ///< file name, for messages
  std::vector<Material> materials{};
  std::vector<std::shared_ptr<const Texture>> textures{};
  std::vector<TriangleMesh> meshes{};
  std::vector<std::shared_ptr<const TriangleMesh>> shapes{};  ///< of meshes that are shown often
  std::vector<Sphere> spheres{};
  std::vector<Cone> cones{};
  std::vector<Light> lights{};
  double light_scale = 1.0;  ///< factor by which expose() multiplied the lights of the file
  std::vector<Camera> cameras{};
  int camera = 0;             ///< index of the camera that places the scene
  std::vector<Node> nodes{};  ///< parents before children
  std::vector<Skin> skins{};
  Vec3 background{0, 0, 0};
  std::optional<Vec3> ambient{};  ///< flat ambient light; default depends on the format
  /// If true, colours are linear light and the picture is sRGB-encoded at the end. If false (NFF),
  /// colours are code values and are written unchanged, as other NFF renderers do.
  bool colour_managed = true;
  /// If true and there are neither lights nor ambient light, the studio lights the scene, and all
  /// its materials are shaded as metallic-roughness ones (docs/render/shading.md).
  bool lit_by_studio = false;
  double duration_seconds = 0.0;  ///< duration of the animation, 0 = still
  /// Repairs and omissions of the loader, for the user ("12 zero-area triangles dropped").
  std::vector<std::string> notes{};
  Selection scenes{}, animations{}, variants{};

  /// Returns the mesh that has the vertices and triangles of `mesh`.
  [[nodiscard]] const TriangleMesh& shape_of(const TriangleMesh& mesh) const {
    return mesh.shape < 0 ? mesh : *shapes[static_cast<size_t>(mesh.shape)];
  }
};

/// Calls visit(mesh) for all meshes in order, each with vertices of its own: those of a shape are
/// moved copies, which end with the call. Throws Error(Input) if a vertex becomes non-finite.
void for_each_mesh(const SceneDescription& scene,
                   const std::function<void(const TriangleMesh&)>& visit);

/// Returns the scene with every node's transform, morph weights and skins applied at `seconds`:
/// meshes, lights and cameras are in world coordinates, and no nodes are left. Key frames are
/// interpolated linearly (rotations along the shorter arc), by cubic splines or not at all, as each
/// channel states, and hold before the first and after the last key. Throws Error(Input) if a
/// vertex becomes non-finite.
[[nodiscard]] SceneDescription at_time(const SceneDescription& scene, double seconds);

}  // namespace lenticule::render
