// SPDX-License-Identifier: Apache-2.0
#include "scenes/nff_writer.h"

#include <fmt/format.h>

#include <iterator>

namespace lenticule::scenes {
namespace {

/// Appends numbers with nine digits, which exceeds single precision. Adding 0 turns -0 into 0.
template <class... Numbers>
void append_numbers(std::string& text, Numbers... numbers) {
  ((fmt::format_to(std::back_inserter(text), " {:.9g}", static_cast<double>(numbers) + 0.0)), ...);
}

}  // namespace

void NffWriter::vector(Vec3 v) {
  append_numbers(text_, v.x, v.y, v.z);
}

void NffWriter::comment(std::string_view text) {
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    text_ += "# ";
    text_ += text.substr(0, end);
    text_ += '\n';
    text.remove_prefix(std::min(end + 1, text.size()));
  }
}

void NffWriter::view(const View& view) {
  text_ += "v\nfrom";
  vector(view.from);
  text_ += "\nat";
  vector(view.at);
  text_ += "\nup";
  vector(view.up);
  text_ += "\nangle";
  append_numbers(text_, view.angle_degrees);
  text_ += "\nhither";
  append_numbers(text_, view.hither);
  text_ += "\nresolution";
  append_numbers(text_, view.resolution, view.resolution);
  text_ += '\n';
}

void NffWriter::background(Vec3 colour) {
  text_ += 'b';
  vector(colour);
  text_ += '\n';
}

void NffWriter::light(Vec3 position, Vec3 colour) {
  text_ += 'l';
  vector(position);
  if (!(colour == Vec3{1, 1, 1})) vector(colour);
  text_ += '\n';
}

void NffWriter::fill(const Fill& fill) {
  text_ += 'f';
  vector(fill.colour);
  append_numbers(text_, fill.diffuse, fill.specular, fill.shine, fill.transmittance,
                 fill.refraction_index);
  text_ += '\n';
}

void NffWriter::sphere(Vec3 centre, double radius) {
  text_ += 's';
  vector(centre);
  append_numbers(text_, radius);
  text_ += '\n';
}

void NffWriter::cone(Vec3 base, double base_radius, Vec3 apex, double apex_radius) {
  text_ += "c\n";
  vector(base);
  append_numbers(text_, base_radius);
  text_ += '\n';
  vector(apex);
  append_numbers(text_, apex_radius);
  text_ += '\n';
}

void NffWriter::polygon(std::span<const Vec3> corners) {
  text_ += fmt::format("p {}\n", corners.size());
  for (const Vec3 corner : corners) {
    vector(corner);
    text_ += '\n';
  }
}

void NffWriter::patch(std::span<const SurfacePoint> corners) {
  text_ += fmt::format("pp {}\n", corners.size());
  for (const SurfacePoint& corner : corners) {
    vector(corner.position);
    vector(corner.normal);
    text_ += '\n';
  }
}

}  // namespace lenticule::scenes
