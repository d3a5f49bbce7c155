// SPDX-License-Identifier: Apache-2.0
// Implements a pinhole camera with Brown's radial distortion, its noise and codes, and its JPEG
// compression.
#include "lab/panel/simulated_sensor.h"

#include <turbojpeg.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "base/parallel_rows.h"
#include "frames/srgb.h"
#include "lab/panel/portable_random.h"
#include "lab/panel/sample_map.h"

namespace lenticule::lab {

using calib::CameraPicture;

CameraRays::CameraRays(const SimulatedCamera& camera)
    : position_(camera.position_mm),
      forward_(normalized(camera.look_at_mm - camera.position_mm)),
      focal_px_(camera.focal_px),
      centre_px_{camera.centre_x_px, camera.centre_y_px},
      k1_(camera.k1),
      k2_(camera.k2),
      pupil_radius_mm_(camera.pupil_mm / 2.0) {
  const Vec3 level_right = normalized(cross(forward_, Vec3{0, 1, 0}));
  const Vec3 level_down = cross(forward_, level_right);
  const double roll = camera.roll_degrees * std::numbers::pi / 180.0;
  right_ = level_right * std::cos(roll) + level_down * std::sin(roll);
  down_ = level_down * std::cos(roll) - level_right * std::sin(roll);
}

Vec3 CameraRays::direction(Vec2 picture) const {
  const Vec2 seen = (picture - centre_px_) * (1.0 / focal_px_);
  const double seen_radius = std::hypot(seen.x, seen.y);
  double radius = seen_radius;
  // Newton steps solve r (1 + k1 r^2 + k2 r^4) = observed radius.
  for (int step = 0; step < 8; ++step) {
    const double squared = radius * radius;
    const double slope = 1.0 + squared * (3.0 * k1_ + 5.0 * k2_ * squared);
    const double miss = radius * stretch(squared) - seen_radius;
    radius -= miss / slope;
    if (std::abs(miss) < 1e-14) break;
  }
  const double undo = seen_radius > 0 ? radius / seen_radius : 1.0;
  return normalized(forward_ + right_ * (seen.x * undo) + down_ * (seen.y * undo));
}

std::optional<Vec2> CameraRays::project(Vec3 point) const {
  const Vec3 v = point - position_;
  const double depth = dot(v, forward_);
  if (!(depth > 0)) return std::nullopt;
  const Vec2 tangent{dot(v, right_) / depth, dot(v, down_) / depth};
  const double bent = stretch(tangent.x * tangent.x + tangent.y * tangent.y);
  return centre_px_ + tangent * (bent * focal_px_);
}

// Compresses and decompresses with libjpeg-turbo.

namespace {

struct CloseJpeg {
  void operator()(void* handle) const { tjDestroy(handle); }
};
using JpegHandle = std::unique_ptr<void, CloseJpeg>;

struct FreeJpeg {
  void operator()(unsigned char* bytes) const { tjFree(bytes); }
};

}  // namespace

bool jpeg_round_trip(std::vector<uint8_t>& codes, int width, int height, int channels,
                     int quality) {
  const int format = channels == 1 ? TJPF_GRAY : TJPF_RGB;
  const int chroma = channels == 1 ? TJSAMP_GRAY : TJSAMP_420;
  const JpegHandle writer(tjInitCompress());
  const JpegHandle reader(tjInitDecompress());
  if (!writer || !reader) return false;
  unsigned char* made = nullptr;
  unsigned long size = 0;
  const int written = tjCompress2(writer.get(), codes.data(), width, 0, height, format, &made,
                                  &size, chroma, quality, 0);
  const std::unique_ptr<unsigned char, FreeJpeg> bytes(made);
  if (written != 0) return false;
  return tjDecompress2(reader.get(), bytes.get(), size, codes.data(), width, 0, height, format,
                       0) == 0;
}

// Simulates noise on the raw mosaic, bilinear colours, the camera's curve, eight bits, JPEG, and
// the conversion back to light.

namespace {

constexpr size_t kNoiseTable = 1U << 16;
constexpr size_t kCurveSteps = 1U << 15;

double encode(const SimulatedCamera& camera, double light) {
  switch (camera.curve) {
    case CameraCurve::Srgb:
      return frames::srgb_from_linear(light);
    case CameraCurve::Gamma:
      return std::pow(light, 1.0 / camera.gamma);
    case CameraCurve::Linear:
      break;
  }
  return light;
}

double decode(const SimulatedCamera& camera, double code) {
  switch (camera.assumed_curve) {
    case CameraCurve::Srgb:
      return frames::linear_from_srgb(code);
    case CameraCurve::Gamma:
      return std::pow(code, camera.gamma);
    case CameraCurve::Linear:
      break;
  }
  return code;
}

/// Returns the value of a table over [0, 1], linear between its entries.
float looked_up(const std::vector<float>& table, float place) {
  const float last = static_cast<float>(table.size() - 1);
  const float at = std::clamp(place, 0.0F, 1.0F) * last;
  const auto below = std::min(static_cast<size_t>(at), table.size() - 2);
  const float part = at - static_cast<float>(below);
  return table[below] + (table[below + 1] - table[below]) * part;
}

/// Mirrors an index beyond the border, which keeps the mosaic's order.
size_t mirrored(int index, int count) {
  if (index < 0) return static_cast<size_t>(-index);
  return static_cast<size_t>(index < count ? index : 2 * count - 2 - index);
}

}  // namespace

Sensor::Sensor(const SimulatedCamera& camera, uint64_t seed)
    : camera_(camera), seed_(seed), noise_(kNoiseTable), encoded_(kCurveSteps + 1) {
  PortableRandom random(seed);
  for (float& value : noise_) value = static_cast<float>(random.gaussian());
  for (size_t step = 0; step <= kCurveSteps; ++step) {
    encoded_[step] = static_cast<float>(
        encode(camera, static_cast<double>(step) / static_cast<double>(kCurveSteps)));
  }
  // Codes are dense without rounding; with rounding only every 257th entry is used.
  decoded_.resize(255 * 257 + 1);
  for (size_t step = 0; step < decoded_.size(); ++step) {
    const double code = static_cast<double>(step) / static_cast<double>(decoded_.size() - 1);
    decoded_[step] = static_cast<float>(decode(camera, code));
  }
}

void Sensor::add_noise(int row, uint64_t picture, std::vector<float>& light) const {
  PortableRandom random(scramble(seed_ + picture) ^ static_cast<uint64_t>(row));
  const auto width = static_cast<size_t>(camera_.width);
  float* values = &light[static_cast<size_t>(row) * width];
  const auto read = static_cast<float>(camera_.read_noise * camera_.read_noise);
  const auto shot = static_cast<float>(camera_.shot_noise * camera_.shot_noise);
  uint64_t bits = 0;
  for (size_t column = 0; column < width; ++column) {
    bits = column % 4 == 0 ? random.bits() : bits >> 16;
    const float value = values[column];
    const float deviation = std::sqrt(read + shot * std::max(0.0F, value));
    values[column] = std::clamp(value + deviation * noise_[bits % kNoiseTable], 0.0F, 1.0F);
  }
}

void Sensor::demosaic_row(int row, const std::vector<float>& mosaic, CameraPicture& out) const {
  const auto width = static_cast<size_t>(camera_.width);
  const float* above = &mosaic[mirrored(row - 1, camera_.height) * width];
  const float* own = &mosaic[static_cast<size_t>(row) * width];
  const float* below = &mosaic[mirrored(row + 1, camera_.height) * width];
  float* rgb = &out.light[static_cast<size_t>(row) * width * 3];
  for (int column = 0; column < camera_.width; ++column, rgb += 3) {
    const size_t left = mirrored(column - 1, camera_.width);
    const size_t right = mirrored(column + 1, camera_.width);
    const auto at = static_cast<size_t>(column);
    const float beside = (own[left] + own[right]) / 2.0F;
    const float over = (above[at] + below[at]) / 2.0F;
    const int colour = mosaic_colour(camera_, column, row);
    if (colour == 1) {  // green pixel: between two reds on even rows, between two blues on odd ones
      rgb[0] = row % 2 == 0 ? beside : over;
      rgb[1] = own[at];
      rgb[2] = row % 2 == 0 ? over : beside;
      continue;
    }
    const float diagonal = (above[left] + above[right] + below[left] + below[right]) / 4.0F;
    rgb[colour] = own[at];
    rgb[1] = (beside + over) / 2.0F;
    rgb[2 - colour] = diagonal;
  }
}

void Sensor::encode_row(int row, CameraPicture& out) const {
  const size_t count = static_cast<size_t>(out.width) * static_cast<size_t>(out.channels);
  float* values = &out.light[static_cast<size_t>(row) * count];
  for (size_t i = 0; i < count; ++i) {
    const float code = looked_up(encoded_, values[i]);
    values[i] =
        camera_.eight_bits ? static_cast<float>(frames::code_from_encoded(code)) / 255.0F : code;
  }
}

void Sensor::decode_row(int row, CameraPicture& out) const {
  const size_t count = static_cast<size_t>(out.width) * static_cast<size_t>(out.channels);
  float* values = &out.light[static_cast<size_t>(row) * count];
  for (size_t i = 0; i < count; ++i) values[i] = looked_up(decoded_, values[i]);
}

bool Sensor::pass_through_jpeg(CameraPicture& out) const {
  std::vector<uint8_t> codes(out.light.size());
  for (size_t i = 0; i < codes.size(); ++i) codes[i] = frames::code_from_encoded(out.light[i]);
  if (!jpeg_round_trip(codes, out.width, out.height, out.channels, camera_.jpeg_quality)) {
    return false;
  }
  for (size_t i = 0; i < codes.size(); ++i) {
    out.light[i] = static_cast<float>(codes[i]) / 255.0F;
  }
  return true;
}

bool Sensor::develop(std::vector<float>& light, uint64_t picture, CameraPicture& out,
                     int threads) const {
  out.width = camera_.width;
  out.height = camera_.height;
  out.channels = camera_.bayer ? 3 : 1;
  for_rows(
      camera_.height, [&](int row) { add_noise(row, picture, light); }, threads);
  out.light.resize(light.size() * static_cast<size_t>(out.channels));
  if (!camera_.bayer) std::copy(light.begin(), light.end(), out.light.begin());
  const auto encode = [&](int row) {
    if (camera_.bayer) demosaic_row(row, light, out);
    encode_row(row, out);
  };
  for_rows(camera_.height, encode, threads);
  if (camera_.jpeg_quality > 0 && !pass_through_jpeg(out)) return false;
  for_rows(
      camera_.height, [&](int row) { decode_row(row, out); }, threads);
  return true;
}
}  // namespace lenticule::lab
