// SPDX-License-Identifier: Apache-2.0
#include "lab/judges/judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/error.h"
#include "base/file.h"
#include "player/process/child_process.h"
#include "render/scene/surroundings.h"

namespace lenticule::lab {

namespace {

using nlohmann::json;

json triple(Vec3 v) { return {v.x, v.y, v.z}; }

json camera_json(const std::optional<render::Camera>& camera) {
  if (!camera)
    return {{"toward", triple(toward_framing_camera())},
            {"vertical_fov_degrees", kModelFovDegrees}};
  return {{"from", triple(camera->from)},
          {"at", triple(camera->at)},
          {"up", triple(camera->up)},
          {"vertical_fov_degrees", camera->vertical_fov_degrees}};
}

std::string reason_file(const JudgeJob& job) { return job.picture + ".txt"; }

/// Returns the last line that is not empty.
std::string last_line(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  return text.substr(text.rfind('\n') + 1);
}

/// Returns the file of jobs.
std::string jobs_text(const std::vector<JudgeJob>& jobs) {
  json list = json::array();
  for (const JudgeJob& job : jobs)
    list.push_back({{"model", job.model},
                    {"picture", job.picture},
                    {"width", job.side_px},
                    {"height", job.side_px},
                    {"camera", camera_json(job.camera)},
                    {"background", triple({})},
                    {"environment", job.environment},
                    {"environment_ahead", triple(job.environment_ahead)},
                    {"light_scale", job.light_scale},
                    {"shadows", true},
                    {"tone_map", "pbr-neutral"},
                    {"exposure", 1.0}});
  return list.dump(1) + '\n';
}

}  // namespace

std::string run_judge(const std::string& program, const std::filesystem::path& jobs_file,
                      const std::vector<JudgeJob>& jobs, std::chrono::seconds limit) {
  for (const JudgeJob& job : jobs) {
    std::filesystem::remove(job.picture);
    std::filesystem::remove(reason_file(job));
  }
  write_text_file(jobs_file, jobs_text(jobs));
  const ProgramRun run = player::run_child({program, jobs_file.string()}, limit);
  if (run.timed_out) return fmt::format("ended after {} s, the limit", limit.count());
  if (run.exit_code == 0) return {};
  const std::string said = last_line(run.output);
  return said.empty() ? fmt::format("failed with exit code {}", run.exit_code) : said;
}

std::string missing_picture(const JudgeJob& job) {
  if (std::filesystem::is_regular_file(job.picture)) return {};
  constexpr uint64_t kLongestReason = 64 << 10;
  if (!std::filesystem::is_regular_file(reason_file(job))) return "no picture";
  const std::string reason = last_line(read_text_file(reason_file(job), kLongestReason));
  return reason.empty() ? "no picture" : reason;
}

// Without refraction an eye at distance Z sees the pixel at x through the point x Z / (Z + g) of
// the sheet, where g is the gap (docs/panel/optics.md). A pitch of 3 Z / (Z + g) subpixels
// therefore gives every pixel a lens of its own, with the pixel's centre on the line from the eye
// through the apex.

namespace {

constexpr double kPixelMm = 0.1;
/// Gap relative to the panel's height. The picture does not depend on it.
constexpr double kGap = 1e-3;
/// Azimuth to the right and elevation of framing_camera().
constexpr double kAzimuthDegrees = 30.0;
constexpr double kElevationDegrees = 20.0;
/// Fraction of the picture's width or height that the bounds fill.
constexpr double kFill = 0.92;

double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

}  // namespace

optics::Rig plain_camera_rig(int side_px, double vertical_fov_degrees) {
  const double height_mm = side_px * kPixelMm;
  const double gap_mm = kGap * height_mm;
  const double distance_mm = height_mm / 2.0 / std::tan(radians(vertical_fov_degrees / 2.0));
  optics::Rig rig;
  rig.name = "plain camera";
  rig.panel.width_px = side_px;
  rig.panel.height_px = side_px;
  rig.panel.pixel_width = Millimetres(kPixelMm);
  rig.panel.pixel_height = Millimetres(kPixelMm);
  rig.panel.layout = optics::SubpixelLayout::cells(1, 1, {optics::PixelCell{}});
  rig.viewing.distance = Millimetres(distance_mm - gap_mm);
  rig.sheet.gap = Millimetres(gap_mm);
  rig.sheet.pitch = Subpixels(3.0 * (distance_mm - gap_mm) / distance_mm);
  // Phases of pixel centres are whole numbers.
  rig.sheet.offset = Lenses(side_px % 2 == 0 ? 0.5 : 0.0);
  return rig;
}

Vec3 toward_framing_camera() {
  const double azimuth = radians(kAzimuthDegrees);
  const double elevation = radians(kElevationDegrees);
  return {std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
          std::cos(azimuth) * std::cos(elevation)};
}

Vec3 environment_ahead() {
  const Vec3 toward = toward_framing_camera();
  return normalized(Vec3{-toward.x, 0, -toward.z});
}

render::Camera framing_camera(const render::SceneDescription& scene) {
  const Box bounds = render::scene_bounds(scene);
  const Vec3 toward = toward_framing_camera();
  const Vec3 right = normalized(cross(Vec3{0, 1, 0}, toward));
  const Vec3 up = cross(toward, right);
  const Vec3 centre = (bounds.low + bounds.high) * 0.5;
  const double tangent = kFill * std::tan(radians(kModelFovDegrees / 2.0));
  double distance = 0.0;
  render::for_each_mesh(scene, [&](const render::TriangleMesh& mesh) {
    for (const auto& triangle : mesh.triangles)
      for (const uint32_t corner : triangle) {
        const Vec3 p = mesh.positions[corner] - centre;
        const double aside = std::max(std::abs(dot(p, right)), std::abs(dot(p, up)));
        distance = std::max(distance, dot(p, toward) + aside / tangent);
      }
  });
  if (!(distance > 0.0))
    throw Error(ErrorKind::Input, scene.source + ": the scene has no extent to be shown");
  return {.from = centre + toward * distance,
          .at = centre,
          .up = {0, 1, 0},
          .vertical_fov_degrees = kModelFovDegrees};
}

render::StageOptions plain_camera_stage(const render::Camera& camera, const optics::Rig& rig) {
  render::StageOptions options;
  options.centre = camera.at;
  options.mm_per_unit = rig.viewing.distance.value / length(camera.from - camera.at);
  options.depth_scale = 1.0;
  return options;
}

namespace {

/// Appends a pixel with a shared exponent: value = mantissa / 256 * 2^(exponent - 128).
void append_rgbe(Vec3 light, std::string& bytes) {
  int exponent = 0;
  const double largest = std::max({light.x, light.y, light.z});
  const double scale = std::frexp(largest, &exponent) * 256.0 / largest;
  for (const double part : {light.x, light.y, light.z})
    bytes.push_back(static_cast<char>(static_cast<uint8_t>(part * scale)));
  bytes.push_back(static_cast<char>(static_cast<uint8_t>(exponent + 128)));
}

}  // namespace

void write_studio(const std::filesystem::path& file, int width, int height) {
  std::string bytes =
      fmt::format("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", height, width);
  for (int j = 0; j < height; ++j) {
    const double from_up = std::numbers::pi * (j + 0.5) / height;
    for (int i = 0; i < width; ++i) {
      const double azimuth = 2.0 * std::numbers::pi * ((i + 0.5) / width - 0.5);
      append_rgbe(Vec3{1, 1, 1} * render::studio_light({std::sin(from_up) * std::sin(azimuth),
                                                        std::cos(from_up),
                                                        -std::sin(from_up) * std::cos(azimuth)}),
                  bytes);
    }
  }
  write_text_file(file, bytes);
}
}  // namespace lenticule::lab
