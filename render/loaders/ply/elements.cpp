// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/ply/elements.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/error.h"
#include "frames/srgb.h"
#include "render/loaders/limits.h"
#include "render/loaders/ply/values.h"
#include "render/loaders/polygon.h"
#include "render/loaders/tangents.h"
#include "render/loaders/text_reader.h"

namespace lenticule::render::ply {
namespace {

/// Meaning of a vertex property.
enum Field { X, Y, Z, Nx, Ny, Nz, Red, Green, Blue, Alpha, U, V, kFields };

constexpr std::array<std::pair<std::string_view, Field>, 23> kFieldNames{{
    {"x", X},
    {"y", Y},
    {"z", Z},
    {"nx", Nx},
    {"ny", Ny},
    {"nz", Nz},
    {"red", Red},
    {"green", Green},
    {"blue", Blue},
    {"alpha", Alpha},
    {"r", Red},
    {"g", Green},
    {"b", Blue},
    {"a", Alpha},
    {"diffuse_red", Red},
    {"diffuse_green", Green},
    {"diffuse_blue", Blue},
    {"u", U},
    {"v", V},
    {"s", U},
    {"t", V},
    {"texture_u", U},
    {"texture_v", V},
}};

Field field_of(const std::string& name) {
  const auto* const found =
      std::ranges::find_if(kFieldNames, [&](const auto& field) { return field.first == name; });
  return found == kFieldNames.end() ? kFields : found->second;
}

/// Returns the largest value of an integer colour; floats are fractions already.
double full_scale(ValueType type) {
  switch (type) {
    case ValueType::Int8:
    case ValueType::Uint8:
      return 255.0;
    case ValueType::Int16:
    case ValueType::Uint16:
      return 65535.0;
    case ValueType::Int32:
    case ValueType::Uint32:
      return 4294967295.0;
    case ValueType::Float32:
    case ValueType::Float64:
      break;
  }
  return 1.0;
}

class ElementReader {
 public:
  ElementReader(const Header& header, std::string_view text, const std::string& source)
      : source_(source),
        header_(header),
        values_(text.substr(header.end), header.encoding, source) {
    out_.mesh.name = "mesh";
  }

  Elements read() {
    for (const ElementKind& kind : header_.elements) {
      if (kind.count > values_.left())
        refuse(fmt::format("{} elements {}, but {} bytes", kind.count, render::quoted(kind.name),
                           values_.left()));
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
  [[noreturn]] void refuse(const std::string& reason) const {
    throw Error(ErrorKind::Input, source_ + ": " + reason);
  }

  void read_vertices(const ElementKind& kind) {
    if (kind.count > kMaxVertices) refuse(fmt::format("more than {} vertices", kMaxVertices));
    std::array<bool, kFields> has{};
    for (const Property& property : kind.properties)
      if (const Field field = field_of(property.name); field != kFields && !property.is_list)
        has[field] = true;
    if (!has[X] || !has[Y] || !has[Z]) refuse("vertices without x, y and z");
    out_.single_precision = header_.encoding != Encoding::Text &&
                            std::ranges::any_of(kind.properties, [](const Property& p) {
                              return p.name == "x" && p.type == ValueType::Float32;
                            });
    for (uint64_t i = 0; i < kind.count; ++i) {
      values_.set_place(&kind.name, i);
      std::array<double, kFields> fields{};
      fields[Alpha] = 1.0;
      for (const Property& property : kind.properties) {
        if (property.is_list) {
          read_list(property);
          continue;
        }
        const Field field = field_of(property.name);
        const double value = values_.next(property.type);
        if (field == kFields) continue;
        const bool colour = field >= Red && field <= Alpha;
        fields[field] = colour ? value / full_scale(property.type) : value;
      }
      add_vertex(fields, has);
    }
  }

  void add_vertex(const std::array<double, kFields>& f, const std::array<bool, kFields>& has) {
    const Vec3 p{f[X], f[Y], f[Z]};
    if (!is_finite(p)) values_.fail("is not finite");
    if (std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) > kMaxCoordinate)
      values_.fail("is too far away");
    out_.mesh.positions.push_back(p);
    if (has[Nx] && has[Ny] && has[Nz]) out_.mesh.normals.push_back({f[Nx], f[Ny], f[Nz]});
    if (has[U] && has[V]) out_.mesh.uvs.push_back(uv_of(f[U], f[V]));
    if (!has[Red] || !has[Green] || !has[Blue]) return;
    const auto share = [](double v) { return std::isfinite(v) ? std::clamp(v, 0.0, 1.0) : 0.0; };
    const auto light = [&](double v) {
      return static_cast<float>(frames::linear_from_srgb(share(v)));
    };
    out_.mesh.colours.push_back(
        {light(f[Red]), light(f[Green]), light(f[Blue]), static_cast<float>(share(f[Alpha]))});
  }

  /// Returns coordinates with v downward; those of files point up.
  static std::array<float, 2> uv_of(double u, double v) {
    constexpr double kFarthest = 1e6;
    if (!(std::abs(u) < kFarthest && std::abs(v) < kFarthest)) return {0.0F, 0.0F};
    return {static_cast<float>(u), static_cast<float>(1.0 - v)};
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
    std::vector<double> corners;
    for (uint64_t i = 0; i < kind.count; ++i) {
      values_.set_place(&kind.name, i);
      corners.clear();
      coordinates_.clear();
      for (const Property& property : kind.properties) {
        if (!property.is_list) {
          out_.face_colours = out_.face_colours || (faces && field_of(property.name) == Red);
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
      face_uvs_.push_back(uv_of(coordinates_[2 * corner], coordinates_[2 * corner + 1]));
  }

  /// Gives every triangle its own vertices if faces have coordinates of their own.
  void finish_texture_coordinates() {
    if (face_uvs_.empty()) return;
    face_uvs_.resize(3 * out_.mesh.triangles.size());
    if (face_uvs_.size() > kMaxVertices) refuse(fmt::format("more than {} vertices", kMaxVertices));
    std::vector<uint32_t> from;
    for (auto& triangle : out_.mesh.triangles) {
      const auto first = static_cast<uint32_t>(from.size());
      from.insert(from.end(), triangle.begin(), triangle.end());
      triangle = {first, first + 1, first + 2};
    }
    select_vertices(out_.mesh, from);
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

}  // namespace

Elements read_elements(const Header& header, std::string_view text, const std::string& source) {
  return ElementReader(header, text, source).read();
}

}  // namespace lenticule::render::ply
