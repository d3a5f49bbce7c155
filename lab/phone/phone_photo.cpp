// SPDX-License-Identifier: Apache-2.0
// Takes a photograph in four steps: rays of the sensor's pixels start at the moving hand
// (ShotRays); they reach lit pixels through the lens sheet, and the sensor adds its noise
// (expose); the phone merges, interpolates, maps and sharpens (develop); the file gets its EXIF
// data (write_photo).
#include "lab/phone/phone_photo.h"

#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "frames/srgb.h"
#include "lab/phone/lens_section.h"

namespace lenticule::lab {

namespace {

/// Returns the EXIF orientation of a phone that is turned by about this angle.
int orientation_of(double roll_degrees) {
  // A sensor turned clockwise by 90 degrees stores the scene turned counter-clockwise.
  constexpr std::array<int, 4> kOrientations = {1, 6, 3, 8};
  const auto quarter = static_cast<int>(std::lround(roll_degrees / 90.0));
  return kOrientations[static_cast<size_t>((quarter % 4 + 4) % 4)];
}

constexpr double kDegree = std::numbers::pi / 180.0;

/// ShotRays returns the ray of each pixel of one photograph: pose, focal length, distortion, and
/// the motion of the hand while the rows are read.
///
/// Lifetime: must not outlive phone and shot. Thread safety: any thread.
class ShotRays {
 public:
  ShotRays(const Phone& phone, const Shot& shot);

  /// Ray starts at the eye of the camera. Panel frame, mm.
  struct Ray {
    Vec3 eye;
    Vec3 direction;
  };
  /// Returns the ray of the point (u, v) of the sensor, pixels.
  [[nodiscard]] Ray ray(double u, double v) const;
  /// Returns the pixel at which a panel point appears, without distortion and motion.
  [[nodiscard]] Vec2 about(Vec2 panel_mm) const;

 private:
  const Phone& phone_;
  const Shot& shot_;
  double longer_, focal_px_ = 0.0;
  Vec2 axis_px_;
  Vec3 forward_, right_, down_;
};

ShotRays::ShotRays(const Phone& phone, const Shot& shot)
    : phone_(phone), shot_(shot), longer_(std::max(phone.width, phone.height)) {
  focal_px_ = phone.focal * longer_ * (1.0 + shot.breathing);
  axis_px_ = {0.5 * phone.width + (phone.axis.x + shot.stabilisation.x) * longer_,
              0.5 * phone.height + (phone.axis.y + shot.stabilisation.y) * longer_};
  forward_ = normalized(Vec3(shot.look_at_mm.x, shot.look_at_mm.y, 0.0) - shot.eye_mm);
  const Vec3 right = normalized(cross(forward_, Vec3(0.0, 1.0, 0.0)));
  const Vec3 down = cross(forward_, right);
  const double c = std::cos(shot.roll_degrees * kDegree);
  const double s = std::sin(shot.roll_degrees * kDegree);
  right_ = c * right + s * down;
  down_ = c * down - s * right;
}

ShotRays::Ray ShotRays::ray(double u, double v) const {
  // Radius r of the tangent from its distorted value.
  const double x = (u - axis_px_.x) / focal_px_, y = (v - axis_px_.y) / focal_px_;
  const double distorted = std::hypot(x, y);
  double r = distorted;
  for (int k = 0; k < 6; ++k) {
    const double square = r * r;
    const double value =
        r * (1.0 + square * (phone_.radial1 + phone_.radial2 * square)) - distorted;
    r -= value / (1.0 + square * (3.0 * phone_.radial1 + 5.0 * phone_.radial2 * square));
  }
  const double part = distorted > 0.0 ? r / distorted : 1.0;
  Vec3 camera{x * part, y * part, 1.0};
  const double seconds = phone_.readout_s * (v / phone_.height - 0.5);
  camera += cross(shot_.turn_degrees_s * (kDegree * seconds), camera);
  return {shot_.eye_mm + shot_.drift_mm_s * seconds,
          right_ * camera.x + down_ * camera.y + forward_ * camera.z};
}

Vec2 ShotRays::about(Vec2 panel_mm) const {
  const Vec3 d = Vec3(panel_mm.x, panel_mm.y, 0.0) - shot_.eye_mm;
  const double z = std::max(dot(d, forward_), 1.0);
  return {axis_px_.x + focal_px_ * dot(d, right_) / z, axis_px_.y + focal_px_ * dot(d, down_) / z};
}

constexpr float kWallLight = 0.03F;  ///< light of the wall around the panel

/// SensorWindow is the part of the sensor on which the panel appears, in pixels.
struct SensorWindow {
  int left = 0, top = 0, right = 0, bottom = 0;
  [[nodiscard]] int width() const { return right - left; }
  [[nodiscard]] int height() const { return bottom - top; }
};

/// Mosaic is the linear light of each pixel of a window, in its own channel.
struct Mosaic {
  SensorWindow window;
  std::vector<float> light;
};

/// Returns the channel of a pixel of the sensor's mosaic: RGGB.
int mosaic_channel(int i, int j) {
  return j % 2 == 0 ? i % 2 : 1 + i % 2;
}

constexpr int kCell = 8;  ///< side of the squares of pixels in which rays are interpolated
/// Samples per pixel and axis. A pixel of a camera has no random samples: with two instead of four,
/// their noise doubles the scatter of the measured phases.
constexpr int kSide = 4;

/// Random is a counter-based generator: the numbers of a pixel do not depend on the order.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(mixed(seed + 0x9e3779b97f4a7c15ULL)) {}
  float uniform() {
    state_ += 0x9e3779b97f4a7c15ULL;
    return static_cast<float>(mixed(state_) >> 40) * 0x1p-24F;
  }
  float normal() {  // Irwin-Hall: four uniform numbers have variance 1/3
    state_ += 0x9e3779b97f4a7c15ULL;
    const uint64_t bits = mixed(state_);
    float sum = 0.0F;
    for (int k = 0; k < 4; ++k) sum += static_cast<float>((bits >> (16 * k)) & 0xffffU);
    return (sum * 0x1p-16F - 2.0F) * 1.7320508F;
  }

 private:
  static uint64_t mixed(uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }
  uint64_t state_;
};

/// Node is a corner of a cell: what its ray meets. Positions in panel pixels.
struct Node {
  double lens = 0.0;
  std::array<Vec2, 3>
      seen;  ///< point of the pixels that a ray through an apex reaches, per channel
  double tan_across = 0.0;
  double tan_along = 0.0;
  bool in_front = false;
};

/// LitPixels returns the light of panel points.
class LitPixels {
 public:
  LitPixels(const LensSection& sheet, const frames::FrameView& shown)
      : build_(sheet.build()),
        shown_(shown),
        width_(shown.geometry.width),
        height_(shown.geometry.height) {
    for (size_t k = 0; k < 256; ++k) linear_[k] = static_cast<float>(frames::linear_of_codes()[k]);
    columns_ = (width_ + kArea - 1) / kArea;
    rows_ = (height_ + kArea - 1) / kArea;
    means_.assign(static_cast<size_t>(columns_ * rows_) * 3, 0.0F);
    std::vector<float> counts(means_.size());
    for (int j = 0; j < height_; ++j)
      for (int i = 0; i < width_; i += 3)
        for (int c = 0; c < 3; ++c) {
          const size_t k = area(i, j, c);
          means_[k] += linear_[shown_.row(j)[3 * i + c]];
          counts[k] += 1.0F;
        }
    for (size_t k = 0; k < means_.size(); ++k) means_[k] /= std::max(counts[k], 1.0F);
    open_ = static_cast<float>((1.0 - 6.0 * build_.matrix_x) * (1.0 - 2.0 * build_.matrix_y));
  }
  /// Returns the light of one point, as a camera pixel with the filter of `channel` sees it; 1 is
  /// the mean light of a white panel.
  [[nodiscard]] float at(float x, float y, int channel) const {
    if (!(x >= 0.0F && y >= 0.0F)) return 0.0F;
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    if (i >= width_ || j >= height_) return 0.0F;
    const float in_y = y - static_cast<float>(j);
    if (std::abs(in_y - 0.5F) > 0.5F - static_cast<float>(build_.matrix_y)) return 0.0F;
    const float thirds = 3.0F * (x - static_cast<float>(i));
    const int s = std::min(static_cast<int>(thirds), 2);
    if (std::abs(thirds - static_cast<float>(s) - 0.5F) >
        0.5F - 3.0F * static_cast<float>(build_.matrix_x))
      return 0.0F;
    const float light = linear_[shown_.row(j)[3 * i + s]];
    const auto leak = static_cast<float>(build_.filter_leak);
    return light * 3.0F / open_ * (s == channel ? 1.0F - 2.0F * leak : leak);
  }
  /// Returns the mean light around a point.
  [[nodiscard]] float around(float x, float y, int channel) const {
    const int i = std::clamp(static_cast<int>(x), 0, width_ - 1);
    const int j = std::clamp(static_cast<int>(y), 0, height_ - 1);
    return means_[area(i, j, channel)];
  }

 private:
  static constexpr int kArea = 48;
  [[nodiscard]] size_t area(int i, int j, int c) const {
    return static_cast<size_t>((j / kArea * columns_ + i / kArea) * 3 + c);
  }
  const SheetBuild& build_;
  const frames::FrameView& shown_;
  int width_, height_, columns_ = 0, rows_ = 0;
  std::array<float, 256> linear_{};
  std::vector<float> means_;
  float open_ = 1.0F;
};

SensorWindow window_of(const ShotRays& rays, const optics::Panel& panel, const Phone& phone) {
  const double x = 0.5 * panel.width_px * panel.pixel_width.value;
  const double y = 0.5 * panel.height_px * panel.pixel_height.value;
  Vec2 least{1e9, 1e9}, most{-1e9, -1e9};
  for (const Vec2 corner : {Vec2{-x, -y}, Vec2{x, -y}, Vec2{-x, y}, Vec2{x, y}}) {
    const Vec2 at = rays.about(corner);
    least = {std::min(least.x, at.x), std::min(least.y, at.y)};
    most = {std::max(most.x, at.x), std::max(most.y, at.y)};
  }
  constexpr double kMargin = 0.03;  // distortion, sharpening
  const double margin = kMargin * std::max(phone.width, phone.height);
  const auto down = [](double at, int size) {
    return std::clamp(static_cast<int>(at) / kCell * kCell, 0, size);
  };
  return {down(least.x - margin, phone.width), down(least.y - margin, phone.height),
          std::clamp(static_cast<int>(most.x + margin), 0, phone.width),
          std::clamp(static_cast<int>(most.y + margin), 0, phone.height)};
}

/// Exposure traces the rays of one photograph, in squares of pixels.
class Exposure {
 public:
  Exposure(const LensSection& sheet, const frames::FrameView& shown, const Phone& phone,
           const Shot& shot)
      : sheet_(sheet),
        pixels_(sheet, shown),
        phone_(phone),
        shot_(shot),
        rays_(phone, shot),
        window_(window_of(rays_, sheet.panel(), phone)),
        shifts_(sheet) {}

  /// Returns the light of each pixel of the window, in its own channel.
  [[nodiscard]] Mosaic expose() {
    std::vector<float> light(static_cast<size_t>(window_.width()) *
                             static_cast<size_t>(window_.height()));
    std::vector<Node> upper, lower = nodes(window_.top);
    for (int top = window_.top; top < window_.bottom; top += kCell) {
      std::swap(upper, lower);
      lower = nodes(top + kCell);
      for (int left = window_.left; left < window_.right; left += kCell) {
        const auto c = static_cast<size_t>((left - window_.left) / kCell);
        fill({&upper[c], &upper[c + 1], &lower[c], &lower[c + 1]}, left, top, light);
      }
    }
    return {window_, std::move(light)};
  }

 private:
  using Corners = std::array<const Node*, 4>;

  [[nodiscard]] std::vector<Node> nodes(int v) const {
    std::vector<Node> row;
    for (int u = window_.left; u <= window_.right + kCell; u += kCell) row.push_back(node(u, v));
    return row;
  }
  [[nodiscard]] Node node(double u, double v) const {
    const ShotRays::Ray ray = rays_.ray(u, v);
    Node n;
    if (!(ray.direction.z < -1e-3)) return n;
    n.in_front = true;
    const double steps = -ray.eye.z / ray.direction.z;
    const Vec2 at{ray.eye.x + steps * ray.direction.x, ray.eye.y + steps * ray.direction.y};
    const double x = (ray.eye.x - at.x) / ray.eye.z, y = (ray.eye.y - at.y) / ray.eye.z;
    const Vec2 across = sheet_.across(), along = sheet_.along();
    n.tan_across = across.x * x + across.y * y;
    n.tan_along = along.x * x + along.y * y;
    n.lens = sheet_.lens_coordinate(at);
    const optics::Panel& panel = sheet_.panel();
    for (int c = 0; c < 3; ++c) {
      const auto shift =
          sheet_.trace(0.0, n.tan_across, n.tan_along, c).value_or(LensSection::Shift{});
      n.seen[static_cast<size_t>(c)] = {
          panel.x_px(at.x + shift.across * across.x + shift.along * along.x),
          panel.y_px(at.y + shift.across * across.y + shift.along * along.y)};
    }
    return n;
  }

  void fill(const Corners& corners, int left, int top, std::vector<float>& light) {
    bool near = true;
    for (const Node* n : corners) near = near && n->in_front;
    Random random(shot_.seed * 1000003 + static_cast<uint64_t>(top) * 65536 +
                  static_cast<uint64_t>(left));
    if (near) {
      const double across = 0.5 * (corners[0]->tan_across + corners[3]->tan_across);
      const double along = 0.5 * (corners[0]->tan_along + corners[3]->tan_along);
      constexpr double kSteepest = 1.15;
      near = std::abs(across) < kSteepest && std::abs(along) < kSteepest;
      const Vec2 a = corners[0]->seen[1];
      const optics::Panel& panel = sheet_.panel();
      constexpr double kRim = 60.0;  // pixels
      near = near && a.x > -kRim && a.y > -kRim && a.x < panel.width_px + kRim &&
             a.y < panel.height_px + kRim;
      if (near)
        for (int c = 0; c < 3; ++c)
          shifts_.evaluate(across, along, c, tables_[static_cast<size_t>(c)]);
    }
    for (int j = top; j < std::min(top + kCell, window_.bottom); ++j)
      for (int i = left; i < std::min(left + kCell, window_.right); ++i) {
        const float seen =
            near ? pixel(corners, i - left, j - top, mosaic_channel(i, j), random) : kWallLight;
        light[static_cast<size_t>(j - window_.top) * static_cast<size_t>(window_.width()) +
              static_cast<size_t>(i - window_.left)] = noisy(seen, i, j, random);
      }
  }

  float pixel(const Corners& corners, int i, int j, int channel, Random& random) const {
    const auto c = static_cast<size_t>(channel);
    const auto& table = tables_[c];
    const Node &n0 = *corners[0], &n1 = *corners[1], &n2 = *corners[2], &n3 = *corners[3];
    const auto haze = static_cast<float>(sheet_.build().haze);
    const auto blur = static_cast<float>(phone_.blur_px);
    float sum = 0.0F;
    for (int s = 0; s < kSide * kSide; ++s) {
      const float du = (static_cast<float>(s % kSide) + random.uniform()) / kSide - 0.5F;
      const float dv = (static_cast<float>(s / kSide) + random.uniform()) / kSide - 0.5F;
      const double u = double{static_cast<float>(i) + 0.5F + blur * du} / kCell;
      const double v = double{static_cast<float>(j) + 0.5F + blur * dv} / kCell;
      const double w0 = (1 - u) * (1 - v), w1 = u * (1 - v), w2 = (1 - u) * v, w3 = u * v;
      const double lens = w0 * n0.lens + w1 * n1.lens + w2 * n2.lens + w3 * n3.lens;
      const auto x = static_cast<float>(w0 * n0.seen[c].x + w1 * n1.seen[c].x + w2 * n2.seen[c].x +
                                        w3 * n3.seen[c].x);
      const auto y = static_cast<float>(w0 * n0.seen[c].y + w1 * n1.seen[c].y + w2 * n2.seen[c].y +
                                        w3 * n3.seen[c].y);
      const double place = lens + 0.5 - std::floor(lens + 0.5);
      const ShiftTable::Offset& o = table[std::min(static_cast<size_t>(place * ShiftTable::kPlaces),
                                                   size_t{ShiftTable::kPlaces - 1})];
      const bool on_panel = x >= 0.0F && y >= 0.0F &&
                            x < static_cast<float>(sheet_.panel().width_px) &&
                            y < static_cast<float>(sheet_.panel().height_px);
      if (!on_panel) {
        sum += kWallLight;
        continue;
      }
      const float around = pixels_.around(x, y, channel);
      const float sharp = std::isnan(o.x) ? around : pixels_.at(x + o.x, y + o.y, channel);
      sum += (1.0F - haze) * sharp + haze * around + static_cast<float>(shot_.room_light);
    }
    return sum / (kSide * kSide);
  }

  float noisy(float light, int i, int j, Random& random) const {
    const double x = 2.0 * i / phone_.width - 1.0, y = 2.0 * j / phone_.height - 1.0;
    const auto exposed = static_cast<float>(light * phone_.exposure *
                                            (1.0 - phone_.vignetting * 0.5 * (x * x + y * y)));
    const float variance = exposed * static_cast<float>(phone_.shot_noise * phone_.shot_noise) +
                           static_cast<float>(phone_.read_noise * phone_.read_noise);
    return exposed + std::sqrt(variance) * random.normal();
  }

  const LensSection& sheet_;
  LitPixels pixels_;
  const Phone& phone_;
  const Shot& shot_;
  ShotRays rays_;
  SensorWindow window_;
  ShiftTable shifts_;
  std::array<ShiftTable::Table, 3> tables_{};
};

/// Returns the exposure of the pixels near the panel that shows `shown` (RGB codes, sRGB).
Mosaic expose(const LensSection& sheet, const frames::FrameView& shown, const Phone& phone,
              const Shot& shot) {
  return Exposure(sheet, shown, phone, shot).expose();
}

/// Picture is linear light with three channels.
struct Picture {
  int width = 0, height = 0;
  std::vector<float> light;
  [[nodiscard]] float* at(int i, int j) {
    return light.data() + 3 * (static_cast<ptrdiff_t>(j) * width + i);
  }
};

/// Adds a second exposure that the hand's motion moved by some pixels.
void merge_moved(Mosaic& mosaic) {
  const SensorWindow& window = mosaic.window;
  std::vector<float>& light = mosaic.light;
  constexpr int kRight = 4, kDown = 2;  // even: the channels of the mosaic agree
  for (int j = window.height() - 1; j >= kDown; --j)
    for (int i = window.width() - 1; i >= kRight; --i) {
      const auto at =
          static_cast<size_t>(j) * static_cast<size_t>(window.width()) + static_cast<size_t>(i);
      const auto from = static_cast<size_t>(j - kDown) * static_cast<size_t>(window.width()) +
                        static_cast<size_t>(i - kRight);
      light[at] = 0.5F * (light[at] + light[from]);
    }
}

/// Interpolates the mosaic bilinearly.
Picture without_mosaic(const Mosaic& mosaic) {
  const SensorWindow& window = mosaic.window;
  const std::vector<float>& light = mosaic.light;
  Picture out{window.width(), window.height(), {}};
  out.light.resize(light.size() * 3);
  const auto inside = [](int k, int size) {  // mirrors, so that the channel stays the same
    return k < 0 ? -k : k >= size ? 2 * size - 2 - k : k;
  };
  const auto raw = [&](int i, int j) {
    return light[static_cast<size_t>(inside(j, out.height)) * static_cast<size_t>(out.width) +
                 static_cast<size_t>(inside(i, out.width))];
  };
  for (int j = 0; j < out.height; ++j)
    for (int i = 0; i < out.width; ++i) {
      const int own = mosaic_channel(i + window.left, j + window.top);
      const float sides = 0.5F * (raw(i - 1, j) + raw(i + 1, j));
      const float ends = 0.5F * (raw(i, j - 1) + raw(i, j + 1));
      float* p = out.at(i, j);
      p[own] = raw(i, j);
      if (own == 1) {
        const bool red_beside = (j + window.top) % 2 == 0;
        p[0] = red_beside ? sides : ends;
        p[2] = red_beside ? ends : sides;
      } else {
        p[1] = 0.5F * (sides + ends);
        p[2 - own] =
            0.25F * (raw(i - 1, j - 1) + raw(i + 1, j - 1) + raw(i - 1, j + 1) + raw(i + 1, j + 1));
      }
    }
  return out;
}

/// Brightens dark regions as phones do: by a power of the mean light around each pixel, which is
/// taken from squares of 64 pixels.
void map_tones(Picture& picture, double exponent) {
  constexpr int kSquare = 64;
  const int columns = picture.width / kSquare + 2, rows = picture.height / kSquare + 2;
  std::vector<float> gain(static_cast<size_t>(columns * rows), 1.0F);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      double sum = 0.0;
      int count = 0;
      for (int j = (r - 1) * kSquare; j < (r + 1) * kSquare; j += 4)
        for (int i = (c - 1) * kSquare; i < (c + 1) * kSquare; i += 4)
          if (i >= 0 && j >= 0 && i < picture.width && j < picture.height) {
            sum += double{picture.at(i, j)[1]};
            ++count;
          }
      constexpr double kUsual = 0.3;
      const double mean = std::max(sum / std::max(count, 1), 0.02);
      gain[static_cast<size_t>(r * columns + c)] =
          static_cast<float>(std::pow(mean / kUsual, -exponent));
    }
  for (int j = 0; j < picture.height; ++j)
    for (int i = 0; i < picture.width; ++i) {
      const int c = i / kSquare, r = j / kSquare;
      const float x = static_cast<float>(i % kSquare) / kSquare;
      const float y = static_cast<float>(j % kSquare) / kSquare;
      const float* g = gain.data() + static_cast<ptrdiff_t>(r) * columns + c;
      const float factor =
          (1 - y) * ((1 - x) * g[0] + x * g[1]) + y * ((1 - x) * g[columns] + x * g[columns + 1]);
      for (int k = 0; k < 3; ++k) picture.at(i, j)[k] *= factor;
    }
}

/// CodeCurve converts light to codes between 0 and 255: sRGB, then an S-shaped curve.
class CodeCurve {
 public:
  explicit CodeCurve(double strength) {
    for (size_t k = 0; k < values_.size(); ++k) {
      const double light = static_cast<double>(k) / static_cast<double>(values_.size() - 1);
      const double code =
          light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
      values_[k] =
          static_cast<float>(255.0 * (code - strength * std::sin(2.0 * std::numbers::pi * code) /
                                                 (2.0 * std::numbers::pi) * 2.0));
    }
  }
  [[nodiscard]] float code(float light) const {
    const float at = std::clamp(light, 0.0F, 1.0F) * static_cast<float>(values_.size() - 1);
    return values_[static_cast<size_t>(at + 0.5F)];
  }

 private:
  std::array<float, 1 << 14> values_{};
};

/// Sharpens the codes of a window and writes them into the photograph.
void sharpen_into(Picture& codes, double strength, const SensorWindow& window, Photo& photo) {
  const auto part = static_cast<float>(strength);
  for (int j = 0; j < codes.height; ++j) {
    const int above = std::max(j - 1, 0), below = std::min(j + 1, codes.height - 1);
    uint8_t* row = photo.codes.data() +
                   3 * (static_cast<size_t>(j + window.top) * static_cast<size_t>(photo.width) +
                        static_cast<size_t>(window.left));
    for (int i = 0; i < codes.width; ++i) {
      const int left = std::max(i - 1, 0), right = std::min(i + 1, codes.width - 1);
      for (int k = 0; k < 3; ++k) {
        const float own = codes.at(i, j)[k];
        const float blurred = 0.25F * own +
                              0.125F * (codes.at(left, j)[k] + codes.at(right, j)[k] +
                                        codes.at(i, above)[k] + codes.at(i, below)[k]) +
                              0.0625F * (codes.at(left, above)[k] + codes.at(right, above)[k] +
                                         codes.at(left, below)[k] + codes.at(right, below)[k]);
        *row++ =
            static_cast<uint8_t>(std::clamp(own + part * (own - blurred) + 0.5F, 0.0F, 255.0F));
      }
    }
  }
}

/// Returns the photograph of an exposure, with the wall around its window; EXIF data are missing.
/// `hdr` merges two exposures and maps the tones strongly.
Photo develop(Mosaic mosaic, const Phone& phone, bool hdr) {
  if (hdr) merge_moved(mosaic);
  Picture picture = without_mosaic(mosaic);
  map_tones(picture, hdr ? 0.5 : phone.tone_mapping);
  const CodeCurve curve(phone.curve);
  for (float& value : picture.light) value = curve.code(value);
  Photo photo;
  photo.width = phone.width;
  photo.height = phone.height;
  photo.codes.assign(static_cast<size_t>(phone.width) * static_cast<size_t>(phone.height) * 3,
                     static_cast<uint8_t>(curve.code(kWallLight)));
  sharpen_into(picture, phone.sharpening, mosaic.window, photo);
  return photo;
}

struct Close {
  void operator()(void* handle) const { tjDestroy(handle); }
  void operator()(unsigned char* bytes) const { tjFree(bytes); }
};

std::string compressed(const Photo& photo, int quality) {
  const std::unique_ptr<void, Close> writer(tjInitCompress());
  unsigned char* made = nullptr;
  unsigned long size = 0;
  const int failed = tjCompress2(writer.get(), photo.codes.data(), photo.width, 0, photo.height,
                                 TJPF_RGB, &made, &size, TJSAMP_420, quality, 0);
  const std::unique_ptr<unsigned char, Close> bytes(made);
  if (failed != 0) throw Error(ErrorKind::Failed, "cannot compress a photograph");
  return {reinterpret_cast<const char*>(bytes.get()), size};
}

/// TiffBlock writes big-endian EXIF entries.
class TiffBlock {
 public:
  void two(unsigned value) {
    bytes_ += static_cast<char>(value >> 8);
    bytes_ += static_cast<char>(value & 255U);
  }
  void four(unsigned value) {
    two(value >> 16);
    two(value & 0xffffU);
  }
  void entry(unsigned tag, unsigned type, unsigned value) {
    two(tag);
    two(type);
    four(1);
    if (type == kShort) {
      two(value);
      two(0);
    } else {
      four(value);
    }
  }
  static constexpr unsigned kShort = 3, kLong = 4;
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// Returns an APP1 segment with the orientation and the focal length on 35 mm film (EXIF 2.3).
std::string exif_segment(const Photo& photo) {
  TiffBlock tiff;
  tiff.two(0x4d4d);  // "MM"
  tiff.two(42);
  tiff.four(8);
  tiff.two(2);
  tiff.entry(0x0112, TiffBlock::kShort, static_cast<unsigned>(photo.orientation));
  tiff.entry(0x8769, TiffBlock::kLong, 8 + 2 + 2 * 12 + 4);
  tiff.four(0);
  tiff.two(1);
  tiff.entry(0xa405, TiffBlock::kShort,
             static_cast<unsigned>(std::lround(photo.stated_focal_35mm)));
  tiff.four(0);
  TiffBlock segment;
  segment.two(0xffe1);
  segment.two(static_cast<unsigned>(2 + 6 + tiff.bytes().size()));
  return segment.bytes() + std::string("Exif\0\0", 6) + tiff.bytes();
}

}  // namespace

Photo photograph(const LensSection& sheet, const frames::FrameView& shown, const Phone& phone,
                 const Shot& shot) {
  Photo photo = develop(expose(sheet, shown, phone, shot), phone, shot.hdr);
  // 35 mm film has a longer side of 36 mm.
  photo.stated_focal_35mm = std::round(36.0 * phone.focal * phone.stated_focal);
  photo.orientation = orientation_of(shot.roll_degrees);
  return photo;
}

void write_photo(const Photo& photo, int quality, const std::filesystem::path& file) {
  std::string bytes = compressed(photo, quality);
  bytes.insert(2, exif_segment(photo));  // after the marker that starts the picture
  write_text_file(file, bytes);
}

void round_trip(Photo& photo, int quality) {
  const std::string bytes = compressed(photo, quality);
  const std::unique_ptr<void, Close> reader(tjInitDecompress());
  if (tjDecompress2(reader.get(), reinterpret_cast<const unsigned char*>(bytes.data()),
                    bytes.size(), photo.codes.data(), photo.width, 0, photo.height, TJPF_RGB,
                    0) != 0)
    throw Error(ErrorKind::Failed, "cannot decompress a photograph");
}
}  // namespace lenticule::lab
