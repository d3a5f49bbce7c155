// SPDX-License-Identifier: Apache-2.0
// STL is a text, or binary and little endian: a header of 80 bytes, the number of facets, and for
// each a normal, three corners and 16 bits. Programs since VisCAM store a colour in these: 5 bits
// for each channel, blue in the lowest, and the highest bit is set if the facet has a colour. Files
// of Magics state "COLOR=" and RGBA in the header, the colour of facets whose highest bit is set;
// other facets have their own, with red in the lowest bits.
// The normals of the file are not used: those of the triangles are as good, and never wrong.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <string_view>

#include "base/text.h"
#include "render/loaders/formats.h"
#include "render/loaders/mesh_cleanup.h"
#include "render/loaders/text_reader.h"

namespace lenticule::render {
namespace {

constexpr size_t kCountAt = 80, kFacetsAt = 84, kFacetBytes = 50;
static_assert(kMaxSceneFileBytes / kFacetBytes * 3 <= kMaxVertices, "and texts are longer");
static_assert(std::endian::native == std::endian::little);

/// A binary file may begin with "solid", too, but has a zero in its header or its count.
bool is_text(std::string_view file) {
  const std::string_view head = file.substr(0, kFacetsAt);
  const size_t begin = std::min(head.find_first_not_of(" \t\r\n"), head.size());
  return lower_case(std::string(head.substr(begin, 5))) == "solid" &&
         std::ranges::none_of(head, [](char c) { return c >= '\0' && c < '\t'; });
}

void add_facet(const std::array<Vec3, 3>& corners, TriangleMesh& mesh) {
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), corners.begin(), corners.end());
  mesh.triangles.push_back({first, first + 1, first + 2});
}

/// Reads all solids; their names mean nothing. Returns false if something else follows them.
bool read_text(std::string_view file, const std::string& source, TriangleMesh& mesh) {
  TextReader text(file, source);
  const auto next = [&] { return lower_case(std::string(text.word().value_or(""))); };
  const auto require = [&](const std::string& word, const char* expected) {
    if (word.empty()) text.fail(fmt::format("the file ends before '{}'", expected));
    if (word != expected)
      text.fail(fmt::format("expected '{}', not {}", expected, render::quoted(word)));
  };
  for (bool inside = false; !text.at_end();) {
    const std::string word = next();
    if (word == "solid" || word == "endsolid") {
      inside = word == "solid";
      text.skip_line();
      continue;
    }
    if (!inside) return false;
    require(word, "facet");
    require(next(), "normal");
    for (int k = 0; k < 3; ++k) (void)next();
    for (const char* expected : {"outer", "loop"}) require(next(), expected);
    std::array<Vec3, 3> corners;
    for (Vec3& corner : corners) {
      require(next(), "vertex");
      corner = text.point("a coordinate");
    }
    for (const char* expected : {"endloop", "endfacet"}) require(next(), expected);
    add_facet(corners, mesh);
  }
  return true;
}

/// Returns the number of bytes after the last facet.
size_t read_binary(std::string_view file, const std::string& source, TriangleMesh& mesh) {
  const auto refuse = [&](size_t byte, const std::string& reason) {
    render::refuse(source, fmt::format("byte {}: {}", byte, reason));
  };
  if (file.size() < kFacetsAt) refuse(file.size(), "the file ends in its header");
  const size_t room = (file.size() - kFacetsAt) / kFacetBytes;
  size_t count = number_at<uint32_t>(file.data() + kCountAt);
  if (count > room)
    refuse(kCountAt, fmt::format("{} facets, but the file has room for {}", count, room));
  if (count == 0) count = room;  // programs that write to a pipe do not go back to it

  constexpr std::string_view kColour = "COLOR=";
  const size_t magics = file.substr(0, kCountAt - 4).find(kColour);
  const bool has_default = magics != std::string_view::npos;
  bool coloured = has_default;
  std::array<float, 4> usual{kPlainGrey, kPlainGrey, kPlainGrey, 1.0F};
  if (has_default) {
    const auto rgb = number_at<std::array<uint8_t, 3>>(file.data() + magics + kColour.size());
    usual = light_of(rgb[0] / 255.0, rgb[1] / 255.0, rgb[2] / 255.0, 1.0);
  }
  for (size_t at = kFacetsAt; mesh.triangles.size() < count; at += kFacetBytes) {
    std::array<Vec3, 3> corners;
    for (size_t k = 0; k < 3; ++k) {
      const size_t byte = at + 12 * (k + 1);
      const auto p = number_at<std::array<float, 3>>(file.data() + byte);
      corners[k] = {p[0], p[1], p[2]};
      if (const char* flaw = flaw_of(corners[k]))
        refuse(byte, fmt::format("a corner of facet {} is {}", mesh.triangles.size(), flaw));
    }
    add_facet(corners, mesh);
    const auto bits = number_at<uint16_t>(file.data() + at + kFacetBytes - 2);
    const auto channel = [&](int shift) { return (bits >> shift & 31) / 31.0; };
    const bool has_own = (bits >> 15 != 0) != has_default;
    coloured = coloured || has_own;
    mesh.colours.insert(mesh.colours.end(), 3,
                        !has_own      ? usual
                        : has_default ? light_of(channel(0), channel(5), channel(10), 1.0)
                                      : light_of(channel(10), channel(5), channel(0), 1.0));
  }
  if (!coloured) mesh.colours.clear();
  return file.size() - kFacetsAt - count * kFacetBytes;
}

}  // namespace

SceneDescription parse_stl(std::span<const uint8_t> bytes, const std::string& source) {
  const std::string_view file = text_of(bytes);
  SceneDescription scene;
  scene.source = source;
  TriangleMesh mesh{.name = "mesh"};
  const bool text = is_text(file);
  if (text) {
    if (!read_text(file, source, mesh))
      scene.notes.emplace_back("text after the last solid left out");
  } else if (const size_t rest = read_binary(file, source, mesh)) {
    scene.notes.push_back(fmt::format("{} bytes after the last facet left out", rest));
  }
  add_only_mesh(std::move(mesh), -1, !text, scene);
  return scene;
}

}  // namespace lenticule::render
