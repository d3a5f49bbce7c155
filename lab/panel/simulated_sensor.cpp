// SPDX-License-Identifier: Apache-2.0
// Implements a pinhole camera with Brown's radial distortion, its mosaic, noise and codes, and its
// JPEG compression.
#include "lab/panel/simulated_sensor.h"

#include <turbojpeg.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "base/error.h"
#include "base/parallel_rows.h"
#include "frames/srgb.h"
#include "lab/panel/portable_random.h"

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

LightTable light_table(const SimulatedCamera& camera, const std::array<float, 256>& light_of_codes,
                       double lit_area) {
  LightTable table{};
  for (size_t own = 0; own < 3; ++own) {
    std::array<double, 3> response{};
    // A camera without mosaic has the sum of the responses of all colours.
    for (size_t row = 0; row < 3; ++row)
      for (size_t c = 0; c < 3; ++c)
        if (row == own || !camera.bayer) response[c] += camera.response[row][c];
    const double white = (response[0] + response[1] + response[2]) / 3.0 * lit_area;
    const double scale = white > 0.0 ? camera.white_light / white : 0.0;
    for (size_t c = 0; c < 3; ++c)
      for (size_t code = 0; code < 256; ++code)
        table[own][c][code] =
            static_cast<float>(scale * response[c] * double{light_of_codes[code]});
  }
  return table;
}

namespace {

/// Mirrors an index beyond the border, which keeps the mosaic's order.
size_t mirrored(int index, int count) {
  if (index < 0) return static_cast<size_t>(-index);
  return static_cast<size_t>(index < count ? index : 2 * count - 2 - index);
}

struct CloseJpeg {
  void operator()(void* handle) const { tjDestroy(handle); }
  void operator()(unsigned char* bytes) const { tjFree(bytes); }
};

}  // namespace

void demosaic_row(const std::vector<float>& mosaic, int width, int height, int row, float* rgb) {
  const auto stride = static_cast<size_t>(width);
  const float* above = &mosaic[mirrored(row - 1, height) * stride];
  const float* own = &mosaic[static_cast<size_t>(row) * stride];
  const float* below = &mosaic[mirrored(row + 1, height) * stride];
  for (int column = 0; column < width; ++column, rgb += 3) {
    const size_t left = mirrored(column - 1, width);
    const size_t right = mirrored(column + 1, width);
    const auto at = static_cast<size_t>(column);
    const float beside = (own[left] + own[right]) / 2.0F;
    const float over = (above[at] + below[at]) / 2.0F;
    const int colour = (row & 1) + (column & 1);
    if (colour == 1) {  // green pixel: between two reds on even rows, between two blues on odd ones
      rgb[0] = row % 2 == 0 ? beside : over;
      rgb[1] = own[at];
      rgb[2] = row % 2 == 0 ? over : beside;
      continue;
    }
    rgb[colour] = own[at];
    rgb[1] = (beside + over) / 2.0F;
    rgb[2 - colour] = (above[left] + above[right] + below[left] + below[right]) / 4.0F;
  }
}

std::string compress_jpeg(const std::vector<uint8_t>& codes, int width, int height, int channels,
                          int quality) {
  const std::unique_ptr<void, CloseJpeg> writer(tjInitCompress());
  unsigned char* made = nullptr;
  unsigned long size = 0;
  const int failed = tjCompress2(writer.get(), codes.data(), width, 0, height,
                                 channels == 1 ? TJPF_GRAY : TJPF_RGB, &made, &size,
                                 channels == 1 ? TJSAMP_GRAY : TJSAMP_420, quality, 0);
  const std::unique_ptr<unsigned char, CloseJpeg> bytes(made);
  if (failed != 0) throw Error(ErrorKind::Failed, "cannot compress a simulated picture");
  return {reinterpret_cast<const char*>(bytes.get()), size};
}

void jpeg_round_trip(std::vector<uint8_t>& codes, int width, int height, int channels,
                     int quality) {
  const std::string bytes = compress_jpeg(codes, width, height, channels, quality);
  const std::unique_ptr<void, CloseJpeg> reader(tjInitDecompress());
  if (tjDecompress2(reader.get(), reinterpret_cast<const unsigned char*>(bytes.data()),
                    bytes.size(), codes.data(), width, 0, height,
                    channels == 1 ? TJPF_GRAY : TJPF_RGB, 0) != 0)
    throw Error(ErrorKind::Failed, "cannot decompress a simulated picture");
}

// Simulates noise on the raw mosaic, the camera's curve, eight bits, JPEG, and the conversion back
// to light.

namespace {

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

}  // namespace

std::vector<float> gaussian_table(uint64_t seed) {
  PortableRandom random(seed);
  std::vector<float> out(1U << 16);
  for (float& value : out) value = static_cast<float>(random.gaussian());
  return out;
}

Sensor::Sensor(const SimulatedCamera& camera, uint64_t seed)
    : camera_(camera), seed_(seed), noise_(gaussian_table(seed)), encoded_(kCurveSteps + 1) {
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
    values[column] = std::clamp(value + deviation * noise_[bits % noise_.size()], 0.0F, 1.0F);
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

void Sensor::pass_through_jpeg(CameraPicture& out) const {
  std::vector<uint8_t> codes(out.light.size());
  for (size_t i = 0; i < codes.size(); ++i) codes[i] = frames::code_from_encoded(out.light[i]);
  jpeg_round_trip(codes, out.width, out.height, out.channels, camera_.jpeg_quality);
  for (size_t i = 0; i < codes.size(); ++i) out.light[i] = static_cast<float>(codes[i]) / 255.0F;
}

void Sensor::develop(std::vector<float>& light, uint64_t picture, CameraPicture& out,
                     int threads) const {
  out.width = camera_.width;
  out.height = camera_.height;
  out.channels = camera_.bayer ? 3 : 1;
  for_rows(
      camera_.height, [&](int row) { add_noise(row, picture, light); }, threads);
  out.light.resize(light.size() * static_cast<size_t>(out.channels));
  if (!camera_.bayer) std::copy(light.begin(), light.end(), out.light.begin());
  const auto encode = [&](int row) {
    if (camera_.bayer)
      demosaic_row(light, out.width, out.height, row,
                   &out.light[static_cast<size_t>(row) * static_cast<size_t>(out.width) * 3]);
    encode_row(row, out);
  };
  for_rows(camera_.height, encode, threads);
  if (camera_.jpeg_quality > 0) pass_through_jpeg(out);
  for_rows(
      camera_.height, [&](int row) { decode_row(row, out); }, threads);
}

}  // namespace lenticule::lab
