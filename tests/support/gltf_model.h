// SPDX-License-Identifier: Apache-2.0
// GltfModel writes small glTF models for tests: start from a quad, change the JSON, add accessors.
#pragma once

#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "optics/vec.h"

namespace lenticule::test {

/// glTF's codes of component types.
enum ComponentCode {
  kByte = 5120,
  kUbyte = 5121,
  kShort = 5122,
  kUshort = 5123,
  kUint = 5125,
  kFloat = 5126
};

using ByteVector = std::vector<uint8_t>;

/// Returns the bytes of numbers in memory, little endian as glTF has them.
template <class T>
[[nodiscard]] ByteVector bytes_of(const std::vector<T>& values) {
  ByteVector bytes(values.size() * sizeof(T));
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

/// GltfModel holds a model that consists of a quad of two triangles in the plane z = 0:
/// (0,0) (1,0) (1,1) (0,1), with normals to +z, texture coordinates (v = 0 at the top), indices,
/// one mesh, one node and one scene.
class GltfModel {
 public:
  GltfModel();
  /// Changes the quad as a case of tests/data/gltf-*.json says:
  ///   - a path such as "node/scale" or "/scenes/0/nodes" names a value of the JSON; null removes
  ///   it
  ///   - {"accessor": TYPE, "of": COMPONENT, "values": [...]} is the number of a new accessor, and
  ///     {"of": COMPONENT, "values": [...]} that of a new buffer view
  ///   - "nodes" and "textures" (by their samplers) are added to those of the quad.
  explicit GltfModel(const nlohmann::ordered_json& changes);

  nlohmann::json json;  ///< all but `buffers`

  /// Returns the only primitive, its attributes, the only node, the only material (added if need
  /// be).
  nlohmann::json& primitive() { return json["meshes"][0]["primitives"][0]; }
  nlohmann::json& attributes() { return primitive()["attributes"]; }
  nlohmann::json& node() { return json["nodes"][0]; }
  nlohmann::json& material();

  /// Adds bytes and a buffer view of them; returns its index.
  int add_view(const ByteVector& bytes, int stride = 0);
  /// Adds an accessor of tightly packed values; `more` are further properties.
  template <class T>
  int add_accessor(const std::vector<T>& values, const char* type, ComponentCode component,
                   const nlohmann::json& more = nlohmann::json::object()) {
    return add_accessor_of(add_view(bytes_of(values)), values.size() * sizeof(T), type, component,
                           more);
  }
  /// Adds an accessor of a number of elements of a view, or of zeros for view -1.
  int add_accessor_at(int view, size_t count, const char* type, ComponentCode component,
                      const nlohmann::json& more = nlohmann::json::object());
  /// Adds a picture of 2 x 2 texels and a texture of it; returns the texture's index. The texels
  /// are red, green, transparent blue (alpha 128) and grey (188).
  int add_texture(const nlohmann::json& sampler = nullptr);
  /// Adds a node with these properties to the scene; returns its index.
  int add_node(const nlohmann::json& node);
  /// Adds an animation of one property of a node.
  void animate(int node, const std::string& path, const std::vector<float>& times,
               const std::vector<float>& values, const char* type,
               const std::string& interpolation = "LINEAR");
  /// Names extensions in extensionsUsed and extensionsRequired.
  void require(const std::string& extension);

  /// Returns the model as JSON with a data URI, or as a binary container.
  [[nodiscard]] ByteVector gltf() const;
  [[nodiscard]] ByteVector glb() const;
  [[nodiscard]] const ByteVector& buffer() const { return buffer_; }

 private:
  int add_accessor_of(int view, size_t bytes, const char* type, ComponentCode component,
                      const nlohmann::json& more);

  ByteVector buffer_;
};

/// Returns the cases of a file.
[[nodiscard]] std::vector<nlohmann::ordered_json> gltf_cases(const std::string& file);

[[nodiscard]] std::string base64(const ByteVector& bytes);
[[nodiscard]] ByteVector small_png();
[[nodiscard]] ByteVector small_webp();

/// Compresses the quad's positions (attribute 0), normals (1) and texture coordinates (2).
[[nodiscard]] ByteVector draco_quad();
/// Compresses vertices of `stride` bytes, or the corners of triangles of 32 bits.
[[nodiscard]] ByteVector meshopt_vertices(const ByteVector& vertices, size_t stride);
[[nodiscard]] ByteVector meshopt_triangles(const std::vector<uint32_t>& corners, size_t vertices);

}  // namespace lenticule::test
