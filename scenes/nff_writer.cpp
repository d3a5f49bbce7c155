// SPDX-License-Identifier: Apache-2.0
#include "scenes/nff_writer.h"

#include <fmt/format.h>

#include <charconv>
#include <iterator>

namespace lenticule::scenes {
namespace {

/// Appends a number with nine digits. Adding 0 turns -0 into 0.
template <class Out>
Out format_number(Out out, double number) {
  return fmt::format_to(out, "{:.9g}", number + 0.0);
}

template <class... Numbers>
void append_numbers(std::string& text, Numbers... numbers) {
  ((text += ' ', format_number(std::back_inserter(text), static_cast<double>(numbers))), ...);
}

}  // namespace

double as_read_from_nff(double number) {
  char digits[32];
  const char* const end = format_number(digits, number);
  double read = 0.0;
  std::from_chars(digits, end, read);
  return read;
}

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

void NffWriter::add(const View& view) {
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

void NffWriter::add(const Background& background) {
  text_ += 'b';
  vector(background.colour);
  text_ += '\n';
}

void NffWriter::add(const PointLight& light) {
  text_ += 'l';
  vector(light.position);
  if (!(light.colour == Vec3{1, 1, 1})) vector(light.colour);
  text_ += '\n';
}

void NffWriter::add(const Fill& fill) {
  text_ += 'f';
  vector(fill.colour);
  append_numbers(text_, fill.diffuse, fill.specular, fill.shine, fill.transmittance,
                 fill.refraction_index);
  text_ += '\n';
}

void NffWriter::add(const Sphere& sphere) {
  text_ += 's';
  vector(sphere.centre);
  append_numbers(text_, sphere.radius);
  text_ += '\n';
}

void NffWriter::add(const Cone& cone) {
  text_ += "c\n";
  vector(cone.base);
  append_numbers(text_, cone.base_radius);
  text_ += '\n';
  vector(cone.apex);
  append_numbers(text_, cone.apex_radius);
  text_ += '\n';
}

void NffWriter::add(const Polygon& polygon) {
  const bool smooth = !polygon.normals.empty();
  text_ += fmt::format("{} {}\n", smooth ? "pp" : "p", polygon.corners.size());
  for (size_t i = 0; i < polygon.corners.size(); ++i) {
    vector(polygon.corners[i]);
    if (smooth) vector(polygon.normals[i]);
    text_ += '\n';
  }
}

}  // namespace lenticule::scenes
