// SPDX-License-Identifier: Apache-2.0
// OBJ and MTL after the appendices of Wavefront's "Advanced Visualizer Manual", with what programs
// added since: colours of vertices, and the words of metallic-roughness materials (Pr, Pm, norm).
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "base/text.h"
#include "render/loaders/formats.h"
#include "render/loaders/mesh_cleanup.h"
#include "render/loaders/text_reader.h"
#include "render/loaders/textures.h"
#include "render/loaders/viewer_choices.h"
#include "render/scene/stage.h"

namespace lenticule::render {
namespace {

using frames::TextureContent;

TextReader reader_of(std::span<const uint8_t> bytes, const std::filesystem::path& file) {
  const std::string_view text = text_of(bytes);
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF"))
    throw input_error("{}: is UTF-16 text", file.string()).remedy("save it as UTF-8");
  return {text, file.string(), "the file is damaged or cut off: export the model again"};
}

/// Words are some of the words that have no effect, quoted for a note.
using Words = std::set<std::string>;
constexpr size_t kMostWords = 8;
void add(Words& words, std::string_view word) {
  if (words.size() < kMostWords) words.insert(render::quoted(word));
}

// ---- MTL

/// PictureMap is a line such as "map_Kd -s 2 2 wood.png".
struct PictureMap {
  std::string file{};
  std::array<double, 3> scale{1, 1, 1}, offset{};
};

/// Mtl holds what the lines of a material state, by their words in lower case.
struct Mtl {
  std::filesystem::path folder{};
  std::map<std::string, Vec3> values{};
  std::map<std::string, PictureMap> maps{};
  Words ignored{};

  [[nodiscard]] const PictureMap* map(const char* key) const {
    const auto found = maps.find(key);
    return found == maps.end() ? nullptr : &found->second;
  }
  [[nodiscard]] Vec3 colour(const char* key, Vec3 otherwise, double high = 1.0) const {
    const auto found = values.find(key);
    const Vec3 c = found == values.end() ? otherwise : found->second;
    return {std::clamp(c.x, 0.0, high), std::clamp(c.y, 0.0, high), std::clamp(c.z, 0.0, high)};
  }
  [[nodiscard]] double number(const char* key, double otherwise, double high = 1.0) const {
    return colour(key, {otherwise, 0, 0}, high).x;
  }
};
using Mtls = std::map<std::string, Mtl>;

/// Reads up to three numbers; the last also stands for those that are left out. Returns the word
/// that is no number, such as "-halo", or nothing.
std::optional<std::string_view> read_values(TextReader& reader, Vec3& to) {
  std::string_view word;
  for (double* value : {&to.x, &to.y, &to.z}) {
    if (reader.more_on_line()) word = *reader.word();
    const auto number = parse_number(word);
    if (!number) return word;
    *value = *number;
  }
  return std::nullopt;
}

PictureMap read_picture_map(TextReader& reader) {
  constexpr const char* kOptions =
      " -s -o -t -mm -bm -blendu -blendv -cc -clamp -texres -imfchan -boost -type ";
  PictureMap map;
  for (TextReader ahead = reader; ahead.more_on_line(); ahead = reader) {
    const std::string_view option = *ahead.word();
    if (!is_one_of(kOptions, option)) break;
    const bool is_vector = is_one_of(" -s -o -t ", option);
    reader = ahead;
    for (size_t n = option == "-mm" ? 1 : is_vector ? 0 : 2; n < 3 && ahead.more_on_line(); ++n) {
      const auto number = parse_number(*ahead.word());
      if (is_vector && !number) break;  // the last ones may be left out
      reader = ahead;
      if (option == "-s" && std::abs(*number) < kFarthestUv) map.scale[n] = *number;
      if (option == "-o" && std::abs(*number) < kFarthestUv) map.offset[n] = *number;
    }
  }
  map.file = reader.rest_of_line();
  return map;
}

void read_mtl(const std::filesystem::path& file, Mtls& mtls) {
  const std::vector<uint8_t> bytes = read_scene_file(file);
  TextReader reader = reader_of(bytes, file);
  Mtl* to = nullptr;
  for (; const auto word = reader.word(); reader.skip_line()) {
    const std::string key = lower_case(std::string(*word));
    if (key == "newmtl") {
      reader.require_at_most(mtls.size() + 1, kMaxMaterials, "materials");
      to = &(mtls[std::string(reader.rest_of_line())] = {.folder = file.parent_path()});
    } else if (to == nullptr || is_one_of(" ka tf illum map_ka sharpness ", key)) {
      continue;  // without an effect in this model of shading, and in most files
    } else if (is_one_of(" map_kd map_d map_ke map_pr map_pm norm ", key)) {
      to->maps[key] = read_picture_map(reader);
    } else if (!is_one_of(" kd ks ke ns ni d tr pr pm pc pcr ps ", key)) {
      add(to->ignored, *word);
    } else if (Vec3 values; const auto wrong = read_values(reader, values)) {
      add(to->ignored, fmt::format("{} {}", *word, *wrong));
    } else {
      to->values[key] = values;
    }
  }
}

/// MaterialMaker converts materials. Lifetime: must not outlive the folder and the textures.
class MaterialMaker {
 public:
  MaterialMaker(const std::filesystem::path& folder, Textures& textures)
      : folder_(folder), textures_(textures) {}

  /// Converts a material. The colours of vertices take the place of its own.
  [[nodiscard]] PbrMaterial make(const Mtl& from, bool vertex_colours) const {
    constexpr double kBrightest = 1e6, kShiniest = 1e5, kUsualIndex = 1.5;
    const Vec3 specular = from.colour("ks", {});
    PbrMaterial to = pbr_like({.specular = std::max({specular.x, specular.y, specular.z}),
                               .shine = std::max(from.number("ns", 1.0, kShiniest), 1.0)});
    if (from.values.contains("pr") || from.values.contains("pm") || from.map("map_pr") ||
        from.map("map_pm")) {
      to.metallic = from.number("pm", from.map("map_pm") ? 1.0 : 0.0);
      to.roughness = from.number("pr", 1.0);
      to.specular = 1.0;
    }
    const double index = from.number("ni", kUsualIndex, 100.0);
    to.ior = index > 1.0 ? index : kUsualIndex;
    to.base_colour =
        vertex_colours ? Vec3{1, 1, 1} : from.colour("kd", {0.6, 0.6, 0.6}, kBrightest);
    to.base_colour_texture = texture(from, "map_kd", "map_d", mix_alpha, TextureContent::Colour);
    if (to.base_colour_texture.texture < 0)
      to.base_colour_texture = texture(from, "map_kd", "", nullptr, TextureContent::Colour);
    to.alpha = from.number("d", 1.0 - from.number("tr", 0.0));
    if (to.alpha < 1.0 || from.map("map_d")) to.alpha_mode = PbrMaterial::AlphaMode::Blend;
    to.metallic_roughness_texture =
        texture(from, "map_pr", "map_pm", mix_metallic_roughness, TextureContent::Data);
    to.normal_texture = texture(from, "norm", "", nullptr, TextureContent::Data);
    to.emission_texture = texture(from, "map_ke", "", nullptr, TextureContent::Colour);
    to.emission = from.colour("ke", {}, kBrightest);
    // A file with a texture and no colour, or black, means the texture.
    if (to.emission_texture.texture >= 0 && to.emission == Vec3{}) to.emission = {1, 1, 1};
    to.clearcoat = from.number("pc", 0.0);
    to.clearcoat_roughness = from.number("pcr", 0.0);
    to.sheen_colour = from.colour("ps", {});
    return to;
  }

 private:
  /// Returns the texture of one map, or of two that are mixed.
  [[nodiscard]] TextureUse texture(const Mtl& from, const char* one, const char* other, Mix mix,
                                   TextureContent content) const {
    const PictureMap* const a = from.map(one);
    const PictureMap* const b = from.map(other);
    if (a == nullptr && b == nullptr) return {};
    const PictureMap& place = a != nullptr ? *a : *b;
    TextureSource source{.name = place.file, .content = content};
    if (b != nullptr) source.name = fmt::format("{} + {}", a != nullptr ? a->file : "", b->file);
    if (from.folder != folder_) source.name = (from.folder / source.name).string();
    const auto decode = [=, &from] {
      if (mix == nullptr || (b == nullptr && mix == mix_alpha))
        return frames::read_texture(named_file(from.folder, a->file), content,
                                    frames::TexelPlace::Anywhere);
      return combined(floats(from, a, content, false),
                      floats(from, b, TextureContent::Data, mix == mix_alpha), mix);
    };
    // The file's v points up, and the scene's down.
    return {.texture = textures_.add(source, decode),
            .uv_map = {place.scale[0], 0.0, place.offset[0], 0.0, place.scale[1],
                       1.0 - place.scale[1] - place.offset[1]}};
  }

  /// Returns the values of a picture, white for none. A mask has its alpha in all channels.
  static frames::FloatImage floats(const Mtl& from, const PictureMap* map, TextureContent content,
                                   bool mask) {
    if (map == nullptr) return white_picture();
    frames::FloatImage image = frames::floats_of(
        frames::read_texture(named_file(from.folder, map->file), content), content);
    bool has_alpha = false;
    for (size_t n = 3; mask && n < image.rgba.size(); n += 4) has_alpha |= image.rgba[n] < 1.0F;
    for (size_t n = 0; has_alpha && n < image.rgba.size(); ++n) image.rgba[n] = image.rgba[n | 3];
    return image;
  }
  /// Takes the green of a mask without alpha, as three.js does.
  static std::array<float, 4> mix_alpha(const float* colour, const float* mask) {
    return {colour[0], colour[1], colour[2], mask[1]};
  }

  const std::filesystem::path& folder_;
  Textures& textures_;
};

// ---- OBJ

constexpr uint32_t kNone = ~0U;

/// Corner of a face: indices of its position, texture coordinates and normal, or kNone.
struct Corner {
  uint32_t position = kNone, uv = kNone, normal = kNone;
};

/// Part is the mesh of the faces of a material that have the same kinds of attributes.
struct Part {
  TriangleMesh mesh{};
  bool has_uvs = false;
};
/// Parts of a material: plain, with normals, with colours, with both.
using Parts = std::array<Part, 4>;

class ObjReader {
 public:
  ObjReader(std::span<const uint8_t> bytes, const std::filesystem::path& file)
      : folder_(file.parent_path()), reader_(reader_of(bytes, file)) {
    scene_.source = file.string();
  }

  SceneDescription read() {
    for (; const auto word = reader_.word(); reader_.skip_line()) read_line(*word);
    finish_meshes();
    finish_materials();
    return std::move(scene_);
  }

 private:
  void read_line(std::string_view kind) {
    if (kind == "v") {
      add_position();
    } else if (kind == "vt") {
      reader_.require_at_most(uvs_.size() + 1, kMaxVertices, "texture coordinates");
      const double u = number_or_0();
      uvs_.push_back(usable_uv(u, 1.0 - number_or_0()));
    } else if (kind == "vn") {
      reader_.require_at_most(normals_.size() + 1, kMaxVertices, "normals");
      const double x = number_or_0(), y = number_or_0();
      normals_.push_back({x, y, number_or_0()});
    } else if (kind == "f" || kind == "fo") {
      add_face();
    } else if (kind == "usemtl") {
      now_ = &parts_[std::string(reader_.rest_of_line())];
      reader_.require_at_most(parts_.size(), kMaxMaterials, "materials");
    } else if (kind == "mtllib") {
      add_libraries();
    } else if (kind == "p" || kind == "l") {
      has_points_or_lines_ = true;
    } else if (!is_one_of(kWithoutEffect, kind)) {
      add(unknown_, kind);
    }
  }

  // ---- vertices

  /// Returns the next number of the line; 0 for none and for NaN, which some programs write.
  [[nodiscard]] double number_or_0() {
    return reader_.more_on_line() ? parse_number(*reader_.word()).value_or(0.0) : 0.0;
  }

  /// Reads "x y z", "x y z w" (w has no effect on polygons) or "x y z r g b".
  void add_position() {
    reader_.require_at_most(positions_.size() + 1, kMaxVertices, "vertices");
    positions_.push_back(reader_.point("a coordinate"));
    Vec3 colour;
    size_t count = 0;
    for (double* value : {&colour.x, &colour.y, &colour.z})
      if (reader_.more_on_line()) *value = reader_.number("a colour"), ++count;
    if (count == 3 || !colours_.empty()) colours_.resize(positions_.size(), kNoColour);
    if (count == 3) colours_.back() = light_of(colour.x, colour.y, colour.z, 1.0);
  }

  [[nodiscard]] bool is_coloured(const Corner& corner) const {
    return corner.position < colours_.size() && colours_[corner.position] != kNoColour;
  }

  // ---- faces

  /// Returns the index that a word states, from 1 or backwards from the last one; kNone if there is
  /// no such element so far.
  [[nodiscard]] uint32_t index(std::string_view word, size_t count) const {
    const auto stated = number_from<int64_t>(word);
    if (!stated) reader_.fail(fmt::format("{} is not an index", quoted(word)));
    const auto size = static_cast<int64_t>(count);
    const bool is_there = *stated != 0 && *stated <= size && *stated >= -size;
    return is_there ? static_cast<uint32_t>(*stated > 0 ? *stated - 1 : size + *stated) : kNone;
  }

  /// Reads "1", "1/2", "1//3" or "1/2/3".
  [[nodiscard]] Corner corner_of(std::string_view word) {
    const std::string_view whole = word;
    Corner corner{.position = index(take_until(word, '/'), positions_.size())};
    if (corner.position == kNone)
      reader_.fail(
          fmt::format("{} names none of the {} vertices so far", quoted(whole), positions_.size()));
    for (const auto& [to, count] :
         {std::pair(&corner.uv, uvs_.size()), std::pair(&corner.normal, normals_.size())})
      if (const std::string_view stated = take_until(word, '/'); !stated.empty()) {
        *to = index(stated, count);
        missing_ += *to == kNone ? 1 : 0;
      }
    return corner;
  }

  void add_face() {
    std::vector<Corner> corners;
    std::vector<Vec3> outline;
    bool coloured = false, smooth = true;
    while (reader_.more_on_line()) {
      reader_.require_at_most(corners.size() + 1, kMaxPolygonVertices, "corners of a face");
      corners.push_back(corner_of(*reader_.word()));
      outline.push_back(positions_[corners.back().position]);
      coloured |= is_coloured(corners.back());
      smooth &= corners.back().normal != kNone;
    }
    if (corners.size() < 3) return void(has_points_or_lines_ = true);
    std::vector<std::array<uint32_t, 3>> triangles{{0, 1, 2}};
    if (corners.size() > 3) triangles = triangulate(outline).triangles;
    if (triangles.empty()) repairs_.dropped_triangles += corners.size() - 2;
    reader_.require_at_most(triangle_count_ += triangles.size(), kMaxTriangles, "triangles");
    reader_.require_at_most(corner_count_ += corners.size(), kMaxVertices, "corners of faces");
    Part& to = (*now_)[(coloured ? 2 : 0) + (smooth ? 1 : 0)];
    TriangleMesh& mesh = to.mesh;
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (const auto& [a, b, c] : triangles)
      mesh.triangles.push_back({first + a, first + b, first + c});
    for (const Corner& c : corners) {
      mesh.positions.push_back(positions_[c.position]);
      mesh.uvs.push_back(c.uv == kNone ? std::array{0.0F, 0.0F} : uvs_[c.uv]);
      to.has_uvs |= c.uv != kNone;
      if (smooth) mesh.normals.push_back(normals_[c.normal]);
      if (coloured) mesh.colours.push_back(is_coloured(c) ? colours_[c.position] : kWhite);
    }
  }

  // ---- scene

  /// Reads the names of a line; a name may have spaces, and ends in ".mtl" unless it is the last.
  void add_libraries() {
    std::string name;
    while (reader_.more_on_line()) {
      const std::string word(*reader_.word());
      name += (name.empty() ? "" : " ") + word;
      if (reader_.more_on_line() && !lower_case(word).ends_with(".mtl")) continue;
      if (name.starts_with("./")) name.erase(0, 2);
      reader_.require_at_most(libraries_.size() + 1, kMostLibraries, "MTL files");
      try {
        if (libraries_.insert(name).second) read_mtl(named_file(folder_, name), mtls_);
      } catch (const Error& error) {
        scene_.notes.push_back(fmt::format("materials left out: {}", error.what()));
      }
      name.clear();
    }
  }

  void note(const char* what, const Words& words) {
    if (!words.empty()) scene_.notes.push_back(fmt::format("{}: {}", what, fmt::join(words, ", ")));
  }

  void finish_meshes() {
    for (auto& [name, parts] : parts_)
      for (Part& part : parts) {
        repairs_ += clean(part.mesh);
        if (!part.has_uvs) part.mesh.uvs.clear();
      }
    const auto is_empty = [](const Part& part) { return part.mesh.triangles.empty(); };
    std::erase_if(parts_,
                  [&](const auto& one) { return std::ranges::all_of(one.second, is_empty); });
    repairs_.write(scene_);
    if (has_points_or_lines_) scene_.notes.emplace_back("points and lines left out");
    if (missing_ > 0)
      scene_.notes.push_back(fmt::format(
          "{} texture coordinates and normals that corners name are not in the file", missing_));
    note("free-form surfaces or unknown lines left out", unknown_);
    if (parts_.empty()) refuse_empty(scene_);
  }

  void finish_materials() {
    Words ignored, unknown;
    // The first round only lists the pictures, so that they are decoded side by side.
    SceneDescription unused;
    Textures listed(unused, Textures::Mode::List), textures(scene_);
    for (const auto& [name, parts] : parts_) {
      if (!name.empty() && !mtls_.contains(name)) add(unknown, name);
      if (ignored.size() < kMostWords) ignored.merge(Words(mtls_[name].ignored));
      static_cast<void>(MaterialMaker(folder_, listed).make(mtls_[name], false));
    }
    note("ignored in materials", ignored);
    note("materials that no MTL file has, shown in grey", unknown);
    textures.decode_all(listed);
    for (auto& [name, parts] : parts_)
      for (Part& part : parts) {
        if (part.mesh.triangles.empty()) continue;
        const bool coloured = !part.mesh.colours.empty();
        const PbrMaterial pbr = MaterialMaker(folder_, textures).make(mtls_[name], coloured);
        if (pbr.normal_texture.texture >= 0) compute_tangents(part.mesh, false);
        part.mesh.name = name.empty() ? "mesh" : name;
        part.mesh.material = static_cast<int>(scene_.materials.size());
        scene_.materials.push_back(
            {.name = part.mesh.name, .pbr = std::make_shared<const PbrMaterial>(pbr)});
        scene_.meshes.push_back(std::move(part.mesh));
      }
  }

  using Colour = std::array<float, 4>;
  static constexpr Colour kWhite{1, 1, 1, 1}, kNoColour{};
  static constexpr size_t kMostLibraries = 1024;
  static constexpr const char* kWithoutEffect =
      " o g s mg lod bevel c_interp d_interp vp end ctech stech usemap shadow_obj trace_obj ";

  std::filesystem::path folder_;
  TextReader reader_;
  SceneDescription scene_;
  std::vector<Vec3> positions_, normals_;
  std::vector<Colour> colours_;  ///< colours of the first positions
  std::vector<std::array<float, 2>> uvs_;
  std::map<std::string, Parts> parts_;
  Parts* now_ = &parts_[""];  ///< of the current material
  Mtls mtls_;
  std::set<std::string> libraries_;
  Words unknown_;
  MeshRepairs repairs_;
  size_t triangle_count_ = 0, corner_count_ = 0, missing_ = 0;
  bool has_points_or_lines_ = false;
};

}  // namespace

SceneDescription parse_obj(std::span<const uint8_t> bytes, const std::filesystem::path& file) {
  return ObjReader(bytes, file).read();
}

}  // namespace lenticule::render
