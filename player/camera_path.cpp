// SPDX-License-Identifier: Apache-2.0
#include "player/camera_path.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "frames/atomic_file.h"
#include "optics/error.h"

namespace lenticule::player {
namespace {

constexpr uint64_t kMaxFileBytes = 64 << 20;
constexpr size_t kPoseNumbers = 9;

/// The numbers of one line; throws for anything else on it.
std::vector<double> numbers_of(std::string_view line, const std::string& place) {
  std::vector<double> numbers;
  const char* at = line.data();
  const char* const end = at + line.size();
  while (true) {
    while (at != end && (*at == ' ' || *at == '\t' || *at == '\r' || *at == ',')) ++at;
    if (at == end) return numbers;
    double value = 0.0;
    const auto [rest, error] = std::from_chars(at, end, value);
    if (error != std::errc{} || !std::isfinite(value))
      throw Error(ErrorKind::Input, fmt::format("{}: not a number", place));
    numbers.push_back(value);
    at = rest;
  }
}

render::Camera camera_of(const std::vector<double>& n, const std::string& place) {
  if (n.size() != kPoseNumbers && n.size() != kPoseNumbers + 1)
    throw Error(ErrorKind::Input, fmt::format("{}: {} numbers instead of 9 or 10", place, n.size()),
                "a line is: from x y z, at x y z, up x y z, and optionally the field of view");
  render::Camera camera;
  camera.name = "path";
  camera.from = {n[0], n[1], n[2]};
  camera.at = {n[3], n[4], n[5]};
  camera.up = {n[6], n[7], n[8]};
  if (n.size() > kPoseNumbers) camera.vertical_fov_degrees = n[kPoseNumbers];
  const Vec3 view = normalized(camera.at - camera.from);
  if (!(length(cross(view, normalized(camera.up))) > 1e-6))
    throw Error(ErrorKind::Input,
                fmt::format("{}: the camera looks at itself or along its up vector", place));
  if (!(camera.vertical_fov_degrees > 0.0) || camera.vertical_fov_degrees >= 180.0)
    throw Error(ErrorKind::Input, fmt::format("{}: a field of view of {} degrees", place,
                                              camera.vertical_fov_degrees));
  return camera;
}

}  // namespace

std::vector<render::Camera> parse_camera_path(std::string_view text, const std::string& source) {
  std::vector<render::Camera> path;
  for (int line_number = 1; !text.empty(); ++line_number) {
    const size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
    line = line.substr(0, line.find('#'));
    const std::string place = fmt::format("{}:{}", source, line_number);
    const std::vector<double> numbers = numbers_of(line, place);
    if (!numbers.empty()) path.push_back(camera_of(numbers, place));
  }
  if (path.empty()) throw Error(ErrorKind::Input, fmt::format("{}: no camera in it", source));
  return path;
}

std::vector<render::Camera> load_camera_path(const std::filesystem::path& file) {
  const std::vector<uint8_t> bytes = frames::read_whole_file(file, kMaxFileBytes);
  return parse_camera_path({reinterpret_cast<const char*>(bytes.data()), bytes.size()},
                           file.string());
}

}  // namespace lenticule::player
