// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/camera_path.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/file.h"
#include "render/loaders/limits.h"
#include "render/loaders/text_reader.h"
#include "render/scene/stage.h"

namespace lenticule::render {
namespace {

constexpr uintmax_t kMaxPathFileBytes = uintmax_t{64} << 20;
constexpr size_t kMaxPoses = 1'000'000;

constexpr size_t kNumbersOfAPose = 9;

/// Returns the numbers of the next line that has any: nine, or ten with the field of view.
std::vector<double> line_of_numbers(TextReader& reader) {
  std::vector<double> numbers{reader.number("the camera's place")};
  while (reader.more_on_line() && numbers.size() <= kNumbersOfAPose)
    numbers.push_back(reader.number("a pose's number"));
  if (numbers.size() < kNumbersOfAPose)
    reader.fail(
        fmt::format("a pose has nine numbers (from, at, up) or ten, not {}", numbers.size()));
  if (reader.more_on_line()) reader.fail("more than ten numbers in a pose");
  for (const double value : numbers)
    if (value < -kMaxCoordinate || value > kMaxCoordinate)
      reader.fail(fmt::format("{:g} is out of range", value));
  return numbers;
}

Camera pose(const std::vector<double>& n, double vertical_fov_degrees, const TextReader& reader) {
  Camera camera;
  camera.name = fmt::format("pose at line {}", reader.line());
  camera.from = {n[0], n[1], n[2]};
  camera.at = {n[3], n[4], n[5]};
  camera.up = {n[6], n[7], n[8]};
  camera.vertical_fov_degrees = vertical_fov_degrees;
  if (camera.from == camera.at) reader.fail("from and at are the same point");
  if (!up_is_usable(camera)) reader.fail("up is parallel to the view direction");
  return camera;
}

}  // namespace

std::vector<Camera> parse_camera_path(std::string_view text, const std::string& source) {
  TextReader reader(text, source);
  std::vector<Camera> path;
  while (!reader.at_end()) {
    const std::vector<double> numbers = line_of_numbers(reader);
    const double fov =
        numbers.size() > kNumbersOfAPose ? numbers.back() : Camera{}.vertical_fov_degrees;
    if (fov < 1e-3 || fov > 179.0)
      reader.fail(fmt::format("field of view of {:g} degrees: not in 0.001 ... 179", fov));
    if (path.size() == kMaxPoses) reader.fail(fmt::format("more than {} poses", kMaxPoses));
    path.push_back(pose(numbers, fov, reader));
  }
  if (path.empty()) throw Error(ErrorKind::Input, source + ": the camera path contains no pose");
  return path;
}

std::vector<Camera> load_camera_path(const std::filesystem::path& file) {
  const std::vector<uint8_t> bytes = read_whole_file(file, kMaxPathFileBytes);
  return parse_camera_path({reinterpret_cast<const char*>(bytes.data()), bytes.size()},
                           file.string());
}

}  // namespace lenticule::render
