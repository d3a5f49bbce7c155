// SPDX-License-Identifier: Apache-2.0
// Scene description as loaders build it: plain data, world coordinates, double precision. The
// renderer commits it to Embree as a render::Scene (render/scene/scene.h).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "optics/vec.h"

namespace lenticule::render {

/// Texture holds an 8-bit sRGB or float image that OpenImageIO decoded to linear light. (0, 0) is
/// the top-left texel.
struct Texture {
  int width = 0;
  int height = 0;
  std::vector<float> rgba{};  ///< linear light, width * height * 4
  bool repeat_u = true;
  bool repeat_v = true;
  std::string name{};
};

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
};

struct TriangleMesh {
  std::string name{};
  int material = 0;
  std::vector<Vec3> positions{};
  std::vector<std::array<uint32_t, 3>> triangles{};
  std::vector<Vec3> normals{};  ///< per vertex, unit, or empty
  std::vector<std::array<float, 2>>
      uvs{};  ///< per vertex, v = 0 at the top of the texture, or empty
  /// Index into SceneDescription::nodes of the node that moves this mesh, or -1 if the mesh is
  /// static.
  int node = -1;
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
};

struct Node {
  std::string name{};
  int parent = -1;
  Affine local{};  ///< used by components that no channel overrides
  Vec3 scale{1, 1, 1};
  std::array<double, 4> rotation{0, 0, 0, 1};  ///< quaternion x, y, z, w
  Vec3 translation{0, 0, 0};
  bool animated = false;
  Channel<Vec3> translations{};
  Channel<std::array<double, 4>> rotations{};
  Channel<Vec3> scales{};
};

struct SceneDescription {
  std::string source{};  ///< file name, for messages
  std::vector<Material> materials{};
  std::vector<std::shared_ptr<const Texture>> textures{};
  std::vector<TriangleMesh> meshes{};
  std::vector<Sphere> spheres{};
  std::vector<Cone> cones{};
  std::vector<Light> lights{};
  std::vector<Camera> cameras{};
  std::vector<Node> nodes{};  ///< parents before children
  Vec3 background{0, 0, 0};
  std::optional<Vec3> ambient{};  ///< flat ambient light; default depends on the format
  /// If true, colours are linear light and the picture is sRGB-encoded at the end. If false (NFF),
  /// colours are code values and are written unchanged, as other NFF renderers do.
  bool colour_managed = true;
  double duration_seconds = 0.0;  ///< duration of the animation, 0 = still
  /// Repairs and omissions of the loader, for the user ("12 zero-area triangles dropped").
  std::vector<std::string> notes{};
};

/// Returns the scene with every node's transform applied at `seconds`: meshes, lights and cameras
/// are in world coordinates, and no nodes are left. Key frames are interpolated linearly (rotations
/// along the shorter arc) and hold before the first and after the last key. Throws Error(Input) if
/// a vertex becomes non-finite.
[[nodiscard]] SceneDescription at_time(const SceneDescription& scene, double seconds);

}  // namespace lenticule::render
