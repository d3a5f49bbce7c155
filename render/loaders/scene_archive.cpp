// SPDX-License-Identifier: Apache-2.0
// The archive is the sequence of all members, in the order in which fields() names them: numbers as
// they are in memory, and a count before the elements of a vector or a text. Writer and Reader are
// the two archives to which fields() passes the members, so that what one writes the other reads.
// Reader believes nothing: it charges each vector to a budget, grows it as its bytes arrive, and
// checks what indices refer to when all of it is there (check_scene).
#include "render/loaders/scene_archive.h"

#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/error.h"
#include "frames/image_io.h"
#include "render/loaders/formats.h"

namespace lenticule::render {
namespace {

[[noreturn]] void refuse(const std::string& cause) { throw Error(ErrorKind::Input, cause); }

constexpr size_t kAlignment = alignof(double);

/// True for types whose bytes are copied: numbers, and arrays and vectors of them.
template <class T>
constexpr bool kIsPlain = std::is_arithmetic_v<T> && !std::is_same_v<T, bool>;
template <class T>
constexpr bool kIsPlain<Vec3T<T>> = true;
template <class T, size_t N>
constexpr bool kIsPlain<std::array<T, N>> = kIsPlain<T>;
template <>
constexpr bool kIsPlain<Affine> = true;

// ---- the members of each struct

void fields(auto& archive, Texture& of) {
  archive(of.width, of.height, of.rgba, of.codes, of.held, of.repeat_u, of.repeat_v, of.mirror_u,
          of.mirror_v, of.name);
}

void fields(auto& archive, TextureUse& of) { archive(of.texture, of.uv_set, of.uv_map); }

void fields(auto& archive, PbrMaterial& of) {
  for (const auto number : kPbrNumbers) archive(of.*number);
  for (const auto colour : kPbrColours) archive(of.*colour);
  for (const auto texture : kPbrTextures) archive(of.*texture);
  archive.choice(of.alpha_mode, PbrMaterial::AlphaMode::Blend);
  archive(of.double_sided, of.unlit);
}

void fields(auto& archive, Material& of) {
  archive(of.name, of.colour, of.diffuse, of.specular, of.shine, of.transmittance,
          of.refraction_index, of.emission, of.tinted_specular, of.two_sided, of.texture, of.pbr);
}

void fields(auto& archive, Skin& of) { archive(of.joints, of.joint_from_mesh); }

void fields(auto& archive, MorphTarget& of) { archive(of.positions, of.normals, of.tangents); }

void fields(auto& archive, Deformation& of) {
  archive(of.targets, of.skin, of.joints_per_vertex, of.joints, of.weights);
}

void fields(auto& archive, TriangleMesh& of) {
  archive(of.name, of.material, of.positions, of.triangles, of.normals, of.uvs, of.uvs2, of.colours,
          of.tangents, of.node, of.deformation, of.shape, of.place);
}

void fields(auto& archive, Sphere& of) { archive(of.centre, of.radius, of.inward, of.material); }

void fields(auto& archive, Cone& of) {
  archive(of.base, of.base_radius, of.apex, of.apex_radius, of.inward, of.material);
}

void fields(auto& archive, Light& of) {
  archive.choice(of.kind, Light::Kind::Spot);
  archive(of.position, of.direction, of.colour, of.falls_off, of.cos_inner, of.cos_outer, of.node);
}

void fields(auto& archive, Camera& of) {
  archive(of.name, of.from, of.at, of.up, of.vertical_fov_degrees, of.hither, of.node);
}

template <class T>
void fields(auto& archive, Channel<T>& of) {
  archive(of.times, of.values, of.steps, of.in_tangents, of.out_tangents);
}

void fields(auto& archive, Node& of) {
  archive(of.name, of.parent, of.local, of.scale, of.rotation, of.translation, of.animated,
          of.translations, of.rotations, of.scales, of.morph_weights, of.morph_weight_keys);
}

void fields(auto& archive, Selection& of) { archive(of.names, of.taken); }

void fields(auto& archive, SceneDescription& of) {
  archive(of.source, of.materials, of.textures, of.meshes, of.shapes, of.spheres, of.cones,
          of.lights, of.light_scale, of.cameras, of.nodes, of.skins, of.background, of.ambient,
          of.colour_managed, of.lit_by_studio, of.duration_seconds, of.notes, of.scenes,
          of.animations, of.variants);
}

// ---- writing

class Writer {
 public:
  explicit Writer(const std::function<std::span<uint8_t>(size_t)>& next) : next_(next) {}

  template <class... T>
  void operator()(T&... of) {
    (put(of), ...);
  }
  template <class T>
  void choice(const T& of, T) {
    const auto number = static_cast<uint8_t>(of);
    put_bytes(&number, 1);
  }
  void finish() { next_(filled_); }

 private:
  template <class T>
  void put(T& of) {
    if constexpr (kIsPlain<T> || std::is_same_v<T, bool>)
      put_bytes(&of, sizeof of);
    else
      fields(*this, of);
  }
  void put_flag(bool of) { put(of); }
  void put(std::string& of) {
    put_count(of.size());
    put_bytes(of.data(), of.size());
  }
  template <class T>
  void put(std::vector<T>& of) {
    put_count(of.size());
    if constexpr (kIsPlain<T>) {
      align();
      put_bytes(of.data(), of.size() * sizeof(T));
    } else
      for (T& one : of) put(one);
  }
  template <class T>
  void put(std::optional<T>& of) {
    put_flag(of.has_value());
    if (of) put(*of);
  }
  /// fields() takes members that can be changed; Writer changes none.
  template <class T>
  void put(std::shared_ptr<const T>& of) {
    put_flag(of != nullptr);
    if (of) put(const_cast<T&>(*of));
  }
  void put_count(uint64_t count) { put_bytes(&count, sizeof count); }
  /// Numbers of 8 bytes begin at multiples of 8 in pieces of 1 MiB, so that Reader need not copy
  /// elements one by one.
  void align() {
    constexpr std::array<uint8_t, kAlignment> kNothing{};
    put_bytes(kNothing.data(), (kAlignment - total_ % kAlignment) % kAlignment);
  }
  void put_bytes(const void* bytes, size_t count) {
    total_ += count;
    const auto* from = static_cast<const uint8_t*>(bytes);
    while (count > 0) {
      if (filled_ == room_.size()) room_ = next_(std::exchange(filled_, 0));
      const size_t part = std::min(count, room_.size() - filled_);
      std::memcpy(room_.data() + filled_, from, part);
      filled_ += part;
      from += part;
      count -= part;
    }
  }

  const std::function<std::span<uint8_t>(size_t)>& next_;
  std::span<uint8_t> room_;
  size_t filled_ = 0;
  uint64_t total_ = 0;
};

// ---- reading

/// Advises the kernel to back memory with huge pages before it is filled. The arrays of a large
/// model fill tens of thousands of small pages, each of which costs a page fault.
void advise_huge_pages(void* data, size_t bytes) {
  constexpr size_t kHugePage = size_t{2} << 20;
  const size_t skipped = -reinterpret_cast<uintptr_t>(data) % kHugePage;
  if (bytes < skipped + kHugePage) return;
  static_cast<void>(madvise(static_cast<char*>(data) + skipped,
                            (bytes - skipped) / kHugePage * kHugePage, MADV_HUGEPAGE));
}

class Reader {
 public:
  explicit Reader(const std::function<std::span<const uint8_t>()>& next) : next_(next) {}

  template <class... T>
  void operator()(T&... of) {
    (take(of), ...);
  }
  template <class T>
  void choice(T& of, T last) {
    uint8_t number = 0;
    take(number);
    if (number > static_cast<uint8_t>(last)) refuse("has a choice that does not exist");
    of = static_cast<T>(number);
  }

 private:
  template <class T>
  void take(T& of) {
    if constexpr (kIsPlain<T>)
      take_bytes(&of, sizeof of);
    else
      fields(*this, of);
  }
  void take(bool& of) {
    uint8_t number = 0;
    take_bytes(&number, 1);
    of = number != 0;
  }
  void take(std::string& of) { take_elements(of, take_count(1)); }
  template <class T>
  void take(std::vector<T>& of) {
    const size_t count = take_count(sizeof(T));
    if constexpr (kIsPlain<T>) {
      align();
      take_elements(of, count);
    } else
      for (size_t n = 0; n < count; ++n) take(of.emplace_back());
  }
  template <class T>
  void take(std::optional<T>& of) {
    bool there = false;
    take(there);
    if (there) take(of.emplace());
  }
  template <class T>
  void take(std::shared_ptr<const T>& of) {
    bool there = false;
    take(there);
    if (!there) return;
    charge(sizeof(T));
    const auto made = std::make_shared<T>();
    take(*made);
    of = made;
  }

  size_t take_count(size_t element_bytes) {
    uint64_t count = 0;
    take(count);
    if (count > kMaxArchiveBytes / element_bytes) refuse("has more elements than fit into memory");
    charge(count * element_bytes);
    return count;
  }
  void charge(uint64_t bytes) {
    if (bytes > budget_) refuse("has more elements than fit into memory");
    budget_ -= bytes;
  }
  /// Grows as the bytes arrive: a false count costs little.
  template <class Elements>
  void take_elements(Elements& of, size_t count) {
    using Element = typename Elements::value_type;
    constexpr size_t kMostAhead = size_t{1} << 28;
    of.reserve(std::min(count, kMostAhead / sizeof(Element)));
    advise_huge_pages(of.data(), of.capacity() * sizeof(Element));
    while (of.size() < count) {
      const auto* const first = reinterpret_cast<const Element*>(left_.data());
      const size_t whole = std::min(count - of.size(), left_.size() / sizeof(Element));
      if (whole > 0 && reinterpret_cast<uintptr_t>(first) % alignof(Element) == 0) {
        of.insert(of.end(), first, first + whole);
        total_ += whole * sizeof(Element);
        left_ = left_.subspan(whole * sizeof(Element));
      } else {  // an element that begins in one piece and ends in the next
        Element one;
        take_bytes(&one, sizeof one);
        of.push_back(one);
      }
    }
  }
  void align() {
    std::array<uint8_t, kAlignment> nothing{};
    take_bytes(nothing.data(), (kAlignment - total_ % kAlignment) % kAlignment);
  }
  void take_bytes(void* bytes, size_t count) {
    total_ += count;
    auto* to = static_cast<uint8_t*>(bytes);
    while (count > 0) {
      if (left_.empty()) left_ = next_();
      const size_t part = std::min(count, left_.size());
      std::memcpy(to, left_.data(), part);
      left_ = left_.subspan(part);
      to += part;
      count -= part;
    }
  }

  const std::function<std::span<const uint8_t>()>& next_;
  std::span<const uint8_t> left_;
  uint64_t budget_ = kMaxArchiveBytes;
  uint64_t total_ = 0;
};

// ---- checks

/// Throws Error(Input) for an index of nothing; -1, which means none, passes unless it is required.
void check_index(int64_t index, size_t count, const char* what, bool required = false) {
  if (index < (required ? 0 : -1) || index >= static_cast<int64_t>(count))
    refuse(std::string("refers to a ") + what + " that does not exist");
}

void check_count(size_t count, size_t wanted, const char* what) {
  if (count != 0 && count != wanted) refuse(std::string("has a wrong number of ") + what);
}

void check(const Texture& texture) {
  const auto side = [](int pixels) { return pixels >= 1 && pixels <= frames::kMaxImageSide; };
  if (!side(texture.width) || !side(texture.height)) refuse("has a texture of an impossible size");
  const size_t values =
      static_cast<size_t>(texture.width) * static_cast<size_t>(texture.height) * 4;
  const bool held = texture.held >= 0;
  if (texture.rgba.size() + texture.codes.size() != (held ? 0 : values) ||
      (!texture.rgba.empty() && !texture.codes.empty()))
    refuse("has a wrong number of texels");
}

template <class T>
void check(const Channel<T>& channel) {
  if (channel.values.size() != channel.times.size()) refuse("has a wrong number of key frames");
  check_count(channel.in_tangents.size(), channel.times.size(), "tangents of key frames");
  if (channel.out_tangents.size() != channel.in_tangents.size())
    refuse("has other numbers of tangents before key frames than after them");
  if (!std::ranges::is_sorted(channel.times)) refuse("has key frames out of order");
}

void check(const Node& node, size_t before) {
  check_index(node.parent, before, "node");
  check(node.translations);
  check(node.rotations);
  check(node.scales);
  const Channel<std::vector<double>>& weights = node.morph_weight_keys;
  check(weights);
  for (const auto* all : {&weights.values, &weights.in_tangents, &weights.out_tangents})
    for (const std::vector<double>& one : *all)
      if (one.size() != weights.values.front().size()) refuse("has a wrong number of weights");
}

void check(const Deformation& deformation, size_t vertices, const SceneDescription& scene) {
  for (const MorphTarget& target : deformation.targets)
    for (const auto* moves : {&target.positions, &target.normals, &target.tangents})
      check_count(moves->size(), vertices, "moves of vertices");
  check_index(deformation.skin, scene.skins.size(), "skin");
  if (deformation.skin < 0) return;
  const size_t per_vertex = deformation.joints_per_vertex;
  if (per_vertex > std::numeric_limits<uint16_t>::max() ||
      deformation.joints.size() != per_vertex * vertices ||
      deformation.weights.size() != per_vertex * vertices)
    refuse("has a wrong number of joints");
  const size_t joints = scene.skins[static_cast<size_t>(deformation.skin)].joints.size();
  for (const uint16_t joint : deformation.joints) check_index(joint, joints, "joint");
}

void check(const TriangleMesh& mesh, const SceneDescription& scene) {
  const size_t vertices = mesh.positions.size();
  for (const auto& triangle : mesh.triangles)
    for (const uint32_t vertex : triangle) check_index(vertex, vertices, "vertex");
  check_count(mesh.normals.size(), vertices, "normals");
  check_count(mesh.uvs.size(), vertices, "texture coordinates");
  check_count(mesh.uvs2.size(), vertices, "texture coordinates");
  check_count(mesh.colours.size(), vertices, "colours");
  check_count(mesh.tangents.size(), vertices, "tangents");
  check_index(mesh.node, scene.nodes.size(), "node");
  check_index(mesh.shape, scene.shapes.size(), "shape");
  if (mesh.deformation) check(*mesh.deformation, vertices, scene);
}

/// Checks what code after the loaders relies on without looking. Values that are not finite are
/// found when the scene is committed.
void check_scene(const SceneDescription& scene) {
  for (const auto& texture : scene.textures) {
    if (!texture) refuse("has no texture where one is");
    check(*texture);
  }
  for (const Material& material : scene.materials) {
    check_index(material.texture, scene.textures.size(), "texture");
    if (!material.pbr) continue;
    for (const auto member : kPbrTextures) {
      const TextureUse& use = (*material.pbr).*member;
      check_index(use.texture, scene.textures.size(), "texture");
      if (use.uv_set != 0 && use.uv_set != 1) refuse("refers to coordinates that do not exist");
    }
  }
  for (size_t n = 0; n < scene.nodes.size(); ++n) check(scene.nodes[n], n);
  for (const Skin& skin : scene.skins) {
    if (skin.joint_from_mesh.size() != skin.joints.size()) refuse("has a wrong number of joints");
    for (const int joint : skin.joints) check_index(joint, scene.nodes.size(), "node", true);
  }
  const auto check_materials = [&](const auto& shapes) {
    for (const auto& shape : shapes)
      check_index(shape.material, scene.materials.size(), "material", true);
  };
  for (const auto& shape : scene.shapes) {
    if (!shape || shape->shape >= 0) refuse("has no shape where one is");
    check(*shape, scene);
  }
  size_t vertices = 0, triangles = 0;
  for (const TriangleMesh& mesh : scene.meshes) {
    check(mesh, scene);
    if (mesh.shape < 0) continue;
    vertices += scene.shape_of(mesh).positions.size();
    triangles += scene.shape_of(mesh).triangles.size();
    if (vertices > kMaxVertices || triangles > kMaxTriangles || mesh.deformation)
      refuse("has too many or impossible copies of shapes");
  }
  check_materials(scene.meshes);
  check_materials(scene.spheres);
  check_materials(scene.cones);
  for (const Light& light : scene.lights) check_index(light.node, scene.nodes.size(), "node");
  for (const Camera& camera : scene.cameras) check_index(camera.node, scene.nodes.size(), "node");
  for (const auto* of : {&scene.scenes, &scene.animations, &scene.variants})
    if (of->taken != Selection::kAll) check_index(of->taken, of->names.size(), "choice");
  if (!(scene.duration_seconds >= 0.0) || !std::isfinite(scene.light_scale))
    refuse("has an impossible duration or light");
}

}  // namespace

void write_scene_archive(const SceneDescription& scene,
                         const std::function<std::span<uint8_t>(size_t written)>& next) {
  Writer writer(next);
  writer(const_cast<SceneDescription&>(scene));
  writer.finish();
}

SceneDescription read_scene_archive(const std::function<std::span<const uint8_t>()>& next) {
  SceneDescription scene;
  try {
    Reader reader(next);
    reader(scene);
  } catch (const std::bad_alloc&) {
    refuse("has more elements than fit into memory");
  }
  check_scene(scene);
  return scene;
}

}  // namespace lenticule::render
