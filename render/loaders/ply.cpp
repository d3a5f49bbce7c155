// SPDX-License-Identifier: Apache-2.0
// PLY after G. Turk, "The PLY Polygon File Format" (1994): a header in text declares elements with
// properties, and the values follow in that order. Also reads what programs added since: triangle
// strips (Stanford: a list that -1 divides into strips), and the texture coordinates of faces and
// "comment TextureFile" of MeshLab.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstddef>
#include <cstring>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/numbers.h"
#include "render/loaders/formats.h"
#include "render/loaders/mesh_cleanup.h"
#include "render/loaders/text_reader.h"
#include "render/loaders/textures.h"

namespace lenticule::render {
namespace {

// ---- header

struct ValueType {
  size_t bytes;
  double (*value)(const std::array<uint8_t, 8>&);
  double full_scale;  ///< the largest value of a colour; floats are fractions already
  bool is_single;
};

template <class T>
constexpr ValueType kType{
    sizeof(T),
    [](const std::array<uint8_t, 8>& bytes) {
      return static_cast<double>(number_at<T>(bytes.data()));
    },
    std::is_integral_v<T> ? static_cast<double>(~uint64_t{0} >> (64 - 8 * sizeof(T))) : 1.0,
    std::is_same_v<T, float>};

struct Property {
  std::string name;
  ValueType type;
  bool is_list = false;
  ValueType count_type{};  ///< type of the number of a list's values
};

struct ElementKind {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

enum class Encoding { Text, LittleEndian, BigEndian };

struct Header {
  Encoding encoding = Encoding::Text;
  std::vector<ElementKind> elements;
  std::string texture;  ///< file name, or empty
  size_t end = 0;       ///< position of the first byte after the header
};

struct TypeNames {
  std::string_view names;  ///< names that is_one_of() compares
  ValueType type;
};
constexpr std::array<TypeNames, 8> kTypes{{{" char int8 ", kType<int8_t>},
                                           {" uchar uint8 ", kType<uint8_t>},
                                           {" short int16 ", kType<int16_t>},
                                           {" ushort uint16 ", kType<uint16_t>},
                                           {" int int32 ", kType<int32_t>},
                                           {" uint uint32 ", kType<uint32_t>},
                                           {" float float32 ", kType<float>},
                                           {" double float64 ", kType<double>}}};

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  constexpr std::string_view kSpace = " \t\r";
  for (size_t at = line.find_first_not_of(kSpace); at != std::string_view::npos;) {
    const size_t end = std::min(line.find_first_of(kSpace, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(kSpace, end);
  }
  return words;
}

/// HeaderReader reads the elements that follow the header, and their properties.
class HeaderReader {
 public:
  HeaderReader(std::string_view text, const std::string& source) : text_(text), source_(source) {}

  /// Reads up to the line end_header. Throws Error(Input) "source:line: reason".
  Header read() {
    if (words_of(next_line()) != std::vector<std::string_view>{"ply"}) fail("expected 'ply'");
    bool has_format = false;
    while (true) {
      const std::string_view line = next_line();
      const auto words = words_of(line);
      // Blender 2.4 wrote "Created by ..." without "comment" before it.
      if (words.empty() || words[0] == "obj_info" || words[0] == "Created") continue;
      if (words[0] == "end_header") break;
      if (words[0] == "comment")
        take_comment(line, words);
      else if (words[0] == "format" && words.size() >= 2)
        has_format = take_format(words[1]);
      else if (words[0] == "element" && words.size() == 3)
        take_element(words);
      else if (words[0] == "property" && !header_.elements.empty())
        header_.elements.back().properties.push_back(property_of(words));
      else
        fail(fmt::format("unexpected {}", render::quoted(line)));
    }
    if (!has_format) fail("the header states no format");
    header_.end = at_;
    return std::move(header_);
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const {
    refuse(fmt::format("{}:{}", source_, line_), reason);
  }

  std::string_view next_line() {
    ++line_;
    size_t end = text_.find_first_of("\r\n", at_);
    if (end == std::string_view::npos) fail("the header does not end");
    const std::string_view line = text_.substr(at_, end - at_);
    if (text_[end] == '\r' && end + 1 < text_.size() && text_[end + 1] == '\n') ++end;
    at_ = end + 1;
    return line;
  }

  void take_comment(std::string_view line, const std::vector<std::string_view>& words) {
    constexpr std::string_view kTexture = "TextureFile";
    if (words.size() < 3 || words[1] != kTexture) return;
    const size_t name = line.find(words[2], line.find(kTexture) + kTexture.size());
    header_.texture = line.substr(name);
  }

  bool take_format(std::string_view name) {
    if (name == "ascii")
      header_.encoding = Encoding::Text;
    else if (name == "binary_little_endian")
      header_.encoding = Encoding::LittleEndian;
    else if (name == "binary_big_endian")
      header_.encoding = Encoding::BigEndian;
    else
      fail(fmt::format("unknown format {}", render::quoted(name)));
    return true;
  }

  void take_element(const std::vector<std::string_view>& words) {
    const auto count = number_from<uint64_t>(words[2]);
    if (!count) fail(fmt::format("{} is no number of elements", render::quoted(words[2])));
    header_.elements.push_back({std::string(words[1]), *count, {}});
  }

  Property property_of(const std::vector<std::string_view>& words) const {
    if (words.size() == 5 && words[1] == "list")
      return {std::string(words[4]), type_named(words[3]), true, type_named(words[2])};
    if (words.size() != 3) fail("expected 'property TYPE NAME' or 'property list TYPE TYPE NAME'");
    if (words[2] == "f_dc_0") fail("Gaussian splats, which have no surfaces: convert it to a mesh");
    return {std::string(words[2]), type_named(words[1])};
  }

  [[nodiscard]] ValueType type_named(std::string_view name) const {
    const auto* const found = std::ranges::find_if(
        kTypes, [&](const TypeNames& type) { return is_one_of(type.names, name); });
    if (found == kTypes.end()) fail(fmt::format("unknown type {}", render::quoted(name)));
    return found->type;
  }

  std::string_view text_;
  const std::string& source_;
  Header header_;
  size_t at_ = 0;
  int line_ = 0;
};

// ---- values

/// Values reads the numbers after the header of a PLY file, in text or binary.
/// Lifetime: must not outlive the data, the source and the element's name.
class Values {
 public:
  Values(std::string_view data, Encoding encoding, const std::string& source)
      : data_(data), encoding_(encoding), source_(source) {}

  /// Throws Error(Input) at the end of the file, and for a word that is no number.
  [[nodiscard]] double next(ValueType type) {
    return encoding_ == Encoding::Text ? next_word() : next_binary(type);
  }

  /// Returns the number of bytes that are left: at least as many as values.
  [[nodiscard]] size_t left() const { return data_.size() - at_; }
  /// Names the element that is read, for messages.
  void set_place(const std::string* element, uint64_t index) {
    element_ = element;
    index_ = index;
  }
  /// Throws Error(Input) "source: element index: reason".
  [[noreturn]] void fail(const std::string& reason) const {
    refuse(fmt::format("{}: {} {}", source_, render::quoted(*element_), index_), reason);
  }

 private:
  [[nodiscard]] double next_word() {
    constexpr std::string_view kSpace = " \t\r\n";
    at_ = std::min(data_.find_first_not_of(kSpace, at_), data_.size());
    const size_t end = std::min(data_.find_first_of(kSpace, at_), data_.size());
    if (end == at_) fail("the file ends here");
    double value = 0.0;
    const char* first = data_.data() + at_;
    const char* const last = data_.data() + end;
    if (*first == '+') ++first;
    const auto [stop, error] = std::from_chars(first, last, value);
    if ((error != std::errc() && error != std::errc::result_out_of_range) || stop != last)
      fail(fmt::format("{} is no number", render::quoted(data_.substr(at_, end - at_))));
    at_ = end;
    return value;
  }

  [[nodiscard]] double next_binary(ValueType type) {
    if (left() < type.bytes) fail("the file ends here");
    std::array<uint8_t, 8> bytes{};
    std::memcpy(bytes.data(), data_.data() + at_, type.bytes);
    at_ += type.bytes;
    if ((encoding_ == Encoding::BigEndian) == (std::endian::native == std::endian::little))
      std::reverse(bytes.begin(), bytes.begin() + type.bytes);
    return type.value(bytes);
  }

  std::string_view data_;
  Encoding encoding_;
  const std::string& source_;
  size_t at_ = 0;
  const std::string* element_ = nullptr;
  uint64_t index_ = 0;
};

// ---- elements

struct Elements {
  TriangleMesh mesh;              ///< mesh as it is in the file, not cleaned
  bool single_precision = false;  ///< true if the positions come from single precision
  bool face_colours = false;      ///< true if faces have colours, which the mesh does not have
  size_t ignored = 0;             ///< elements of other kinds, and faces with less than 3 corners
};

/// Meaning of a vertex property.
enum Field { X, Y, Z, Nx, Ny, Nz, Red, Green, Blue, Alpha, U, V, kFields };

/// Names of the fields, for is_one_of().
constexpr auto kFieldNames = std::to_array<std::string_view>(
    {" x ", " y ", " z ", " nx ", " ny ", " nz ", " red r diffuse_red ", " green g diffuse_green ",
     " blue b diffuse_blue ", " alpha a ", " u s texture_u ", " v t texture_v "});
static_assert(kFieldNames.size() == kFields);

/// Returns kFields for properties that mean nothing, and for lists.
Field field_of(const Property& property) {
  const auto has_name = [&](std::string_view names) { return is_one_of(names, property.name); };
  const auto* const found = std::ranges::find_if(kFieldNames, has_name);
  return property.is_list ? kFields : static_cast<Field>(found - kFieldNames.begin());
}

/// ElementReader reads vertices, faces and triangle strips into a mesh.
class ElementReader {
 public:
  ElementReader(const Header& header, std::string_view text, const std::string& source)
      : source_(source),
        header_(header),
        values_(text.substr(header.end), header.encoding, source) {
    out_.mesh.name = "mesh";
  }

  /// Throws Error(Input) "source: element: reason".
  Elements read() {
    for (const ElementKind& kind : header_.elements) {
      if (kind.count > values_.left())
        refuse(source_, fmt::format("{} elements {}, but {} bytes", kind.count,
                                    render::quoted(kind.name), values_.left()));
      if (kind.properties.empty()) continue;
      if (kind.name == "vertex")
        read_vertices(kind);
      else
        read_lists(kind);
    }
    finish_texture_coordinates();
    return std::move(out_);
  }

 private:
  void read_vertices(const ElementKind& kind) {
    if (kind.count > kMaxVertices)
      refuse(source_, fmt::format("more than {} vertices", kMaxVertices));
    std::array<bool, kFields + 1> has{};
    std::vector<Field> meanings;
    for (const Property& property : kind.properties)
      has[meanings.emplace_back(field_of(property))] = true;
    if (!has[X] || !has[Y] || !has[Z]) refuse(source_, "vertices without x, y and z");
    out_.single_precision = header_.encoding != Encoding::Text &&
                            std::ranges::any_of(kind.properties, [](const Property& p) {
                              return p.name == "x" && p.type.is_single;
                            });
    for (uint64_t i = 0; i < kind.count; ++i) {
      values_.set_place(&kind.name, i);
      std::array<double, kFields> fields{};
      fields[Alpha] = 1.0;
      for (size_t k = 0; k < meanings.size(); ++k) {
        const Property& property = kind.properties[k];
        if (property.is_list) {
          read_list(property);
          continue;
        }
        const Field field = meanings[k];
        const double value = values_.next(property.type);
        if (field == kFields) continue;
        const bool colour = field >= Red && field <= Alpha;
        fields[field] = colour ? value / property.type.full_scale : value;
      }
      add_vertex(fields, has);
    }
  }

  void add_vertex(const std::array<double, kFields>& f, const std::array<bool, kFields + 1>& has) {
    const Vec3 p{f[X], f[Y], f[Z]};
    if (const char* flaw = flaw_of(p)) values_.fail(fmt::format("is {}", flaw));
    out_.mesh.positions.push_back(p);
    if (has[Nx] && has[Ny] && has[Nz]) out_.mesh.normals.push_back({f[Nx], f[Ny], f[Nz]});
    if (has[U] && has[V]) out_.mesh.uvs.push_back(usable_uv(f[U], 1.0 - f[V]));
    if (has[Red] && has[Green] && has[Blue])
      out_.mesh.colours.push_back(light_of(f[Red], f[Green], f[Blue], f[Alpha]));
  }

  /// Reads the values of a list into list_.
  void read_list(const Property& property) {
    const double count = values_.next(property.count_type);
    if (!(count >= 0.0) || count > static_cast<double>(values_.left()))
      values_.fail(fmt::format("a list of {:g} values, {} bytes are left", count, values_.left()));
    list_.clear();
    for (auto left = static_cast<size_t>(count); left > 0; --left)
      list_.push_back(values_.next(property.type));
  }

  /// Reads faces, triangle strips, and elements of other kinds.
  void read_lists(const ElementKind& kind) {
    const bool strips = kind.name == "tristrips" || kind.name == "tristrip";
    const bool faces = kind.name == "face";
    const auto is_red = [](const Property& property) { return field_of(property) == Red; };
    out_.face_colours |= faces && kind.count > 0 && std::ranges::any_of(kind.properties, is_red);
    std::vector<double> corners;
    for (uint64_t i = 0; i < kind.count; ++i) {
      values_.set_place(&kind.name, i);
      corners.clear();
      coordinates_.clear();
      for (const Property& property : kind.properties) {
        if (!property.is_list) {
          static_cast<void>(values_.next(property.type));
          continue;
        }
        read_list(property);
        if (property.name == "vertex_indices" || property.name == "vertex_index")
          corners = list_;
        else if (property.name == "texcoord")
          coordinates_ = list_;
      }
      if (strips) add_strips(corners);
      if (faces) add_polygon(corners);
      if (!strips && !faces) ++out_.ignored;
    }
  }

  [[nodiscard]] uint32_t vertex(double index) const {
    if (!(index >= 0.0 && index < static_cast<double>(out_.mesh.positions.size())))
      values_.fail(fmt::format("names vertex {:g} of {}", index, out_.mesh.positions.size()));
    return static_cast<uint32_t>(index);
  }

  void add_triangle(const std::array<uint32_t, 3>& triangle) {
    if (out_.mesh.triangles.size() == kMaxTriangles)
      values_.fail(fmt::format("more than {} triangles", kMaxTriangles));
    out_.mesh.triangles.push_back(triangle);
  }

  /// Adds the triangles of strips; every second triangle of a strip is reversed.
  void add_strips(const std::vector<double>& indices) {
    constexpr double kRestart = -1.0;
    std::vector<uint32_t> strip;
    for (const double index : indices) {
      if (index == kRestart) {
        strip.clear();
        continue;
      }
      strip.push_back(vertex(index));
      const size_t n = strip.size();
      if (n < 3) continue;
      if (n % 2 == 1)
        add_triangle({strip[n - 3], strip[n - 2], strip[n - 1]});
      else
        add_triangle({strip[n - 2], strip[n - 3], strip[n - 1]});
    }
  }

  void add_polygon(const std::vector<double>& indices) {
    if (indices.size() < 3) {
      ++out_.ignored;
      return;
    }
    if (indices.size() > size_t{kMaxPolygonVertices})
      values_.fail(fmt::format("more than {} corners", kMaxPolygonVertices));
    std::vector<uint32_t> corners;
    for (const double index : indices) corners.push_back(vertex(index));
    if (corners.size() == 3) {
      add_face_triangle(corners, {0, 1, 2});
      return;
    }
    std::vector<Vec3> outline;
    for (const uint32_t corner : corners) outline.push_back(out_.mesh.positions[corner]);
    for (const auto& triangle : triangulate(outline).triangles)
      add_face_triangle(corners, triangle);
  }

  /// Adds a triangle of corners of a polygon, with the polygon's own texture coordinates.
  void add_face_triangle(const std::vector<uint32_t>& corners,
                         const std::array<uint32_t, 3>& triangle) {
    add_triangle({corners[triangle[0]], corners[triangle[1]], corners[triangle[2]]});
    if (coordinates_.size() < 2 * corners.size()) return;
    face_uvs_.resize(3 * (out_.mesh.triangles.size() - 1));  // triangles without coordinates: zeros
    for (const uint32_t corner : triangle)
      face_uvs_.push_back(usable_uv(coordinates_[2 * corner], 1.0 - coordinates_[2 * corner + 1]));
  }

  /// Gives every triangle its own vertices if faces have coordinates of their own.
  void finish_texture_coordinates() {
    if (face_uvs_.empty()) return;
    face_uvs_.resize(3 * out_.mesh.triangles.size());
    if (face_uvs_.size() > kMaxVertices)
      refuse(source_, fmt::format("more than {} vertices", kMaxVertices));
    split_vertices(out_.mesh);
    out_.mesh.uvs = std::move(face_uvs_);
  }

  const std::string& source_;
  const Header& header_;
  Values values_;
  Elements out_;
  std::vector<double> list_;
  std::vector<double> coordinates_;  ///< texture coordinates of the current face's corners
  std::vector<std::array<float, 2>> face_uvs_;
};

// ---- scene

/// Returns the scene of the elements; its texture lies in `folder`.
SceneDescription scene_of(Elements elements, const std::string& texture, const std::string& source,
                          const std::filesystem::path& folder) {
  SceneDescription scene;
  scene.source = source;
  const size_t points = elements.mesh.positions.size();
  if (elements.mesh.triangles.empty() && points > 0)
    scene.notes.push_back(fmt::format("{} points without faces left out", points));
  if (elements.ignored > 0)
    scene.notes.push_back(
        fmt::format("{} elements other than faces and triangle strips left out", elements.ignored));
  if (elements.face_colours) scene.notes.emplace_back("colours of faces left out");
  int number = -1;
  if (!texture.empty())
    number = Textures(scene).add({.name = texture}, [&] {
      return frames::read_texture(named_file(folder, texture), frames::TextureContent::Colour,
                                  frames::TexelPlace::Anywhere);
    });
  add_only_mesh(std::move(elements.mesh), number, elements.single_precision, scene);
  return scene;
}

}  // namespace

SceneDescription parse_ply(std::span<const uint8_t> bytes, const std::string& source,
                           const std::filesystem::path& folder) {
  const std::string_view text = text_of(bytes);
  const Header header = HeaderReader(text, source).read();
  return scene_of(ElementReader(header, text, source).read(), header.texture, source, folder);
}

}  // namespace lenticule::render
