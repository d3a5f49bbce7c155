// SPDX-License-Identifier: Apache-2.0
// Tests that random meshes, written as OBJ in any of its styles, are read back as they were.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "render/loaders/formats.h"

namespace lenticule::render {
namespace {

struct Corner {
  Vec3 position;
  std::array<float, 2> uv{};
  Vec3 normal;  ///< zero if the face has no normals
  friend bool operator==(const Corner&, const Corner&) = default;
};
/// Corners of the triangles, by material and whether they have normals.
using Faces = std::map<std::pair<std::string, bool>, std::vector<Corner>>;

/// Writer writes random triangles as text, and keeps what they are.
class Writer {
 public:
  explicit Writer(unsigned seed) : random_(seed) {}

  std::string write(Faces& faces) {
    for (int n = 0; n < 40; ++n) {
      // Faces may stand between vertices.
      if (positions_.size() < 3 || chance(3)) add_vertices();
      if (chance(4)) {
        material_ = fmt::format("material {}", random_() % 3);
        text_ += "usemtl " + material_ + "\n";
      }
      if (positions_.size() >= 3) add_face(faces);
    }
    return text_;
  }

 private:
  bool chance(unsigned of) { return random_() % of == 0; }
  double number() { return std::uniform_real_distribution(-1e3, 1e3)(random_); }

  void line(const std::string& content) {
    text_ += content + (chance(8) ? " # comment" : "") + (crlf_ ? "\r\n" : "\n");
  }

  void add_vertices() {
    for (int n = 0; n < 4; ++n) {
      const Vec3 p{number(), number(), number()};
      positions_.push_back(p);
      line(fmt::format("v {} {}{} {}", p.x, p.y, chance(8) ? " \\\n" : "", p.z));
      const auto u = static_cast<float>(random_() % 8), v = static_cast<float>(random_() % 8);
      uvs_.push_back({u, 1.0F - v});
      line(fmt::format("vt {} {}{}", u, v, chance(2) ? " 0" : ""));
    }
    const Vec3 axes[] = {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}};
    normals_.push_back(axes[random_() % 3]);
    line(fmt::format("vn {} {} {}", normals_.back().x, normals_.back().y, normals_.back().z));
  }

  /// Writes an index forwards or backwards.
  std::string index(size_t at, size_t count) {
    const auto number = static_cast<int64_t>(at);
    return std::to_string(chance(2) ? number + 1 : number - static_cast<int64_t>(count));
  }

  void add_face(Faces& faces) {
    const bool has_uvs = !chance(3), has_normals = chance(2);
    std::string words = "f";
    const size_t first = random_() % (positions_.size() - 2);
    for (size_t p = first; p < first + 3; ++p) {
      const size_t uv = random_() % uvs_.size(), normal = random_() % normals_.size();
      words += " " + index(p, positions_.size());
      if (has_uvs || has_normals) words += "/";
      if (has_uvs) words += index(uv, uvs_.size());
      if (has_normals) words += "/" + index(normal, normals_.size());
      faces[{material_, has_normals}].push_back({positions_[p],
                                                 has_uvs ? uvs_[uv] : std::array<float, 2>{},
                                                 has_normals ? normals_[normal] : Vec3{}});
    }
    line(words);
  }

  std::mt19937 random_;
  bool crlf_ = chance(2);
  std::string text_, material_ = "mesh";
  std::vector<Vec3> positions_, normals_;
  std::vector<std::array<float, 2>> uvs_;
};

TEST(ObjProperty, RandomMeshesAreReadBackAsTheyWere) {
  for (unsigned seed = 0; seed < 300; ++seed) {
    SCOPED_TRACE(seed);
    Faces written, read;
    const std::string text = Writer(seed).write(written);
    const SceneDescription scene =
        parse_obj({reinterpret_cast<const uint8_t*>(text.data()), text.size()}, "model.obj");
    for (const TriangleMesh& mesh : scene.meshes)
      for (const auto& triangle : mesh.triangles)
        for (const uint32_t corner : triangle)
          read[{mesh.name, !mesh.normals.empty()}].push_back(
              {mesh.positions[corner], mesh.uvs.empty() ? std::array<float, 2>{} : mesh.uvs[corner],
               mesh.normals.empty() ? Vec3{} : mesh.normals[corner]});
    ASSERT_TRUE(written == read) << text;
  }
}

}  // namespace
}  // namespace lenticule::render
