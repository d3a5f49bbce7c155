// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/assimp/obj_centre.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <string_view>

namespace lenticule::render {
namespace {

/// At this multiple of the size, single precision still resolves a small fraction of a pixel.
constexpr double kFarMultiple = 64.0;

/// A line with a position: its numbers, and the text after the third.
struct Position {
  Vec3 point;
  std::string_view rest;
};

bool is_space(char c) {
  return c == ' ' || c == '\t';
}

/// Takes a number from the front of the text.
std::optional<double> take_number(std::string_view& text) {
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return value;
}

bool is_position(std::string_view line) {
  return line.size() > 2 && line[0] == 'v' && is_space(line[1]);
}

/// Parses a line "v x y z ..."; returns nothing for one that cannot be moved.
std::optional<Position> position_of(std::string_view line) {
  line.remove_prefix(1);
  const auto x = take_number(line);
  const auto y = take_number(line);
  const auto z = take_number(line);
  if (!x || !y || !z || !is_finite(Vec3{*x, *y, *z})) return std::nullopt;
  // A fourth number alone is a homogeneous coordinate; three more are a colour.
  std::string_view rest = line;
  const auto w = take_number(rest);
  if (w && !take_number(rest)) return std::nullopt;
  return Position{{*x, *y, *z}, line};
}

/// Calls visit(line, end of line) for each line; stops when it returns false.
template <class Visit>
bool each_line(std::string_view text, Visit visit) {
  while (!text.empty()) {
    const size_t size = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, size);
    text.remove_prefix(std::min(size + 1, text.size()));
    while (!line.empty() && is_space(line.front())) line.remove_prefix(1);
    if (!visit(line)) return false;
  }
  return true;
}

}  // namespace

std::optional<CentredObj> centre_obj(std::span<const uint8_t> file) {
  const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
  if (text.find("\\\n") != std::string_view::npos || text.find("\\\r") != std::string_view::npos)
    return std::nullopt;
  Vec3 low{INFINITY, INFINITY, INFINITY};
  Vec3 high = -low;
  const bool movable = each_line(text, [&](std::string_view line) {
    if (!is_position(line)) return true;
    const auto position = position_of(line);
    if (!position) return false;
    const Vec3 p = position->point;
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    return true;
  });
  const Vec3 size = high - low;
  const Vec3 centre = low + size / 2.0;
  const double extent = std::max({size.x, size.y, size.z});
  const double distance = std::max({std::abs(centre.x), std::abs(centre.y), std::abs(centre.z)});
  if (!movable || !(distance > kFarMultiple * extent) || !std::isfinite(distance))
    return std::nullopt;

  CentredObj centred{{}, centre};
  centred.text.reserve(file.size());
  auto out = std::back_inserter(centred.text);
  each_line(text, [&](std::string_view line) {
    if (is_position(line)) {
      const auto position = position_of(line);
      const Vec3 p = position->point - centre;
      fmt::format_to(out, "v {:.9g} {:.9g} {:.9g}{}\n", p.x, p.y, p.z, position->rest);
    } else {
      fmt::format_to(out, "{}\n", line);
    }
    return true;
  });
  return centred;
}

}  // namespace lenticule::render
