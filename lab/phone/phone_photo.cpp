// SPDX-License-Identifier: Apache-2.0
// Takes a photograph in three steps: rays of the sensor's pixels start at the moving hand, reach
// lit subpixels through the lens sheet, and the sensor adds its noise (Exposure); the phone merges,
// interpolates, maps and sharpens (develop); the file gets its EXIF data (write_photo). Sheet,
// camera geometry, subpixels, haze and mosaic are those of the simulated bench.
//
// A photograph has a hundred times as many rays as a picture of the bench, and is taken once. So
// rays are not stored for further frames, and only those at the corners of small squares of pixels
// are traced: between them, the position on the sheet and the way through a lens (ShiftTable) are
// interpolated.
#include "lab/phone/phone_photo.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "base/file.h"
#include "frames/srgb.h"
#include "lab/panel/driven_panel.h"
#include "lab/panel/portable_random.h"
#include "lab/panel/simulated_sensor.h"

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
constexpr double kFilterLeak = 0.03;  ///< transmission of a colour filter for another channel

/// Returns the phone as it is held for the shot, without the hand's motion.
SimulatedCamera camera_of(const Phone& phone, const Shot& shot) {
  const double longer = std::max(phone.width, phone.height);
  SimulatedCamera camera;
  camera.width = phone.width;
  camera.height = phone.height;
  camera.focal_px = phone.focal * longer * (1.0 + shot.breathing);
  camera.centre_x_px = 0.5 * phone.width + (phone.axis.x + shot.stabilisation.x) * longer;
  camera.centre_y_px = 0.5 * phone.height + (phone.axis.y + shot.stabilisation.y) * longer;
  camera.k1 = phone.radial1;
  camera.k2 = phone.radial2;
  camera.position_mm = shot.eye_mm;
  camera.look_at_mm = {shot.look_at_mm.x, shot.look_at_mm.y, 0.0};
  camera.roll_degrees = shot.roll_degrees;
  camera.white_light = 1.0;
  for (size_t own = 0; own < 3; ++own)
    for (size_t c = 0; c < 3; ++c)
      camera.response[own][c] = own == c ? 1.0 - 2.0 * kFilterLeak : kFilterLeak;
  return camera;
}

/// Returns the displacement of a point of the sensor, in pixels, by what is not radial.
Vec2 displacement(const Phone& phone, const SimulatedCamera& camera, Vec2 at) {
  const Vec2 middle{0.5 * phone.width, 0.5 * phone.height};
  const double longer = std::max(phone.width, phone.height);
  const Vec2 place = (at - middle) * (1.0 / longer);
  Vec2 sum;
  for (const Wave& wave : phone.warp)
    sum = sum + wave.shift * (longer * std::sin(2.0 * std::numbers::pi *
                                                (wave.turns_per_side.x * place.x +
                                                 wave.turns_per_side.y * place.y + wave.turns)));
  const Vec2 t = (at - Vec2{camera.centre_x_px, camera.centre_y_px}) * (1.0 / camera.focal_px);
  const double squared = t.x * t.x + t.y * t.y;
  const auto [first, second] = phone.tangential;
  return sum + Vec2{2.0 * first * t.x * t.y + second * (squared + 2.0 * t.x * t.x),
                    first * (squared + 2.0 * t.y * t.y) + 2.0 * second * t.x * t.y} *
                   camera.focal_px;
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

constexpr int kCell = 8;  ///< side of the squares of pixels in which rays are interpolated
/// Samples per pixel and axis. A pixel of a camera has no random samples: with two instead of four,
/// their noise doubles the scatter of the measured phases.
constexpr int kSide = 4;
/// A picture that motion blurs is the mean of so many, each with kSide - 1 samples.
constexpr unsigned kSubExposures = 2;

SensorWindow window_of(SimulatedCamera camera, const optics::Panel& panel) {
  camera.k1 = camera.k2 = 0.0;
  const CameraRays rays(camera);
  const double x = 0.5 * panel.width_px * panel.pixel_width.value;
  const double y = 0.5 * panel.height_px * panel.pixel_height.value;
  Vec2 least{1e6, 1e6}, most{-1e6, -1e6};
  for (const Vec3& corner : {Vec3{-x, -y, 0}, Vec3{x, -y, 0}, Vec3{-x, y, 0}, Vec3{x, y, 0}}) {
    const std::optional<Vec2> at = rays.project(corner);
    if (!at) return {0, 0, camera.width, camera.height};
    least = {std::clamp(at->x, -1e6, least.x), std::clamp(at->y, -1e6, least.y)};
    most = {std::clamp(at->x, most.x, 1e6), std::clamp(at->y, most.y, 1e6)};
  }
  constexpr double kMargin = 0.03;  // distortion, sharpening
  const double margin = kMargin * std::max(camera.width, camera.height);
  const auto down = [](double at, int size) {
    return std::clamp(static_cast<int>(at) / kCell * kCell, 0, size);
  };
  return {down(least.x - margin, camera.width), down(least.y - margin, camera.height),
          std::clamp(static_cast<int>(most.x + margin), 0, camera.width),
          std::clamp(static_cast<int>(most.y + margin), 0, camera.height)};
}

/// ShiftTable holds, for directions in steps, where rays of all places under a lens arrive relative
/// to the ray through the apex. A ray that does not arrive has a NaN.
///
/// Thread safety: one thread, because tables are traced when they are first used.
class ShiftTable {
 public:
  static constexpr size_t kPlaces = 256;  ///< number of places under a lens

  /// Shift between two points of the pixels, in panel pixels.
  struct Offset {
    float x = 0.0F, y = 0.0F;
  };
  using Table = std::array<Offset, kPlaces>;

  explicit ShiftTable(const SheetShape& sheet)
      : panel_(sheet.panel()),
        lenses_{sheet.lenses_at({}, 0), sheet.lenses_at({}, 1), sheet.lenses_at({}, 2)},
        across_(lenses_[1].across()),
        tables_(size_t{3} * kSteps * kSteps) {}

  /// Returns the tangents of a direction across and along the lenses.
  [[nodiscard]] Vec2 in_lens(Vec2 v) const {
    return {across_.x * v.x + across_.y * v.y, across_.x * v.y - across_.y * v.x};
  }

  /// Returns the way to the point of the pixels, in panel pixels, of a ray that crosses the plane
  /// of the apices at `place` pitches from an apex and goes on to an eye in the direction (across,
  /// along, 1).
  [[nodiscard]] std::optional<Vec2> shift(double place, Vec2 tangents, size_t channel) const {
    const LensStack& stack = lenses_[channel].stack;
    const double u = place * stack.pitch_mm;
    const std::optional<Vec2> at =
        land(stack, {u, 0.0}, normalized(Vec3{-tangents.x, -tangents.y, -1.0}));
    if (!at) return std::nullopt;
    const Vec2 way{at->x - u, at->y};
    return Vec2{(way.x * across_.x - way.y * across_.y) / panel_.pixel_width.value,
                -(way.x * across_.y + way.y * across_.x) / panel_.pixel_height.value};
  }

  /// Interpolates the table of a direction.
  void evaluate(Vec2 tangents, size_t channel, Table& out) {
    const double a = std::clamp(tangents.x / kStep + kSteps / 2.0, 0.0, kSteps - 2.0);
    const double b = std::clamp(tangents.y / kStep + kSteps / 2.0, 0.0, kSteps - 2.0);
    const auto i = static_cast<size_t>(a), j = static_cast<size_t>(b);
    const auto fa = static_cast<float>(a - std::floor(a)),
               fb = static_cast<float>(b - std::floor(b));
    const auto& v00 = table(i, j, channel);
    const auto& v10 = table(i + 1, j, channel);
    const auto& v01 = table(i, j + 1, channel);
    const auto& v11 = table(i + 1, j + 1, channel);
    const float w00 = (1 - fa) * (1 - fb), w10 = fa * (1 - fb), w01 = (1 - fa) * fb, w11 = fa * fb;
    for (size_t k = 0; k < kPlaces; ++k) {
      out[k].x = w00 * v00[k].x + w10 * v10[k].x + w01 * v01[k].x + w11 * v11[k].x;
      out[k].y = w00 * v00[k].y + w10 * v10[k].y + w01 * v01[k].y + w11 * v11[k].y;
    }
  }

 private:
  static constexpr size_t kSteps = 120;
  static constexpr double kStep = 0.02;

  const Table& table(size_t i, size_t j, size_t channel) {
    std::optional<Table>& made = tables_[(channel * kSteps + j) * kSteps + i];
    if (made) return *made;
    made.emplace();
    const Vec2 tangents{(static_cast<double>(i) - kSteps / 2.0) * kStep,
                        (static_cast<double>(j) - kSteps / 2.0) * kStep};
    const std::optional<Vec2> apex = shift(0.0, tangents, channel);
    for (size_t k = 0; k < kPlaces; ++k) {
      const double place = (static_cast<double>(k) + 0.5) / kPlaces - 0.5;
      const std::optional<Vec2> way = shift(place, tangents, channel);
      (*made)[k] = way && apex ? Offset{static_cast<float>(way->x - apex->x),
                                        static_cast<float>(way->y - apex->y)}
                               : Offset{std::nanf(""), std::nanf("")};
    }
    return *made;
  }

  optics::Panel panel_;
  std::array<LocalLenses, 3> lenses_;
  Vec2 across_;
  std::vector<std::optional<Table>> tables_;
};

/// Node is a corner of a cell: what its ray meets. Positions in panel pixels.
struct Node {
  double lens = 0.0;
  std::array<Vec2, 3>
      seen;  ///< point of the pixels that a ray through an apex reaches, per channel
  Vec2 tangents;
  bool in_front = false;
};

/// Exposure traces the rays of one photograph, in squares of pixels.
class Exposure {
 public:
  Exposure(const SheetShape& sheet, const frames::FrameView& shown, const Phone& phone,
           const Shot& shot)
      : sheet_(sheet),
        panel_(sheet.panel()),
        phone_(phone),
        shot_(shot),
        side_(shot.exposure_s > 0.0 ? kSide - 1 : kSide),
        camera_(camera_of(phone, shot)),
        rays_(camera_),
        turn_(rays_.from_camera(shot.turn_degrees_s * kDegree)),
        window_(window_of(camera_, panel_)),
        shifts_(sheet),
        driven_(drive(shown, Chroma::Full)),
        finder_(panel_, sheet.sheet().black_matrix),
        table_(light_table(camera_, light_of_codes({}), 1.0 - sheet.sheet().black_matrix)),
        haze_(block_light(driven_, panel_, light_of_codes({}))),
        noise_(gaussian_table(shot.seed)) {}

  /// Returns the light of each pixel of the window, in its own channel.
  [[nodiscard]] Mosaic expose() {
    if (shot_.exposure_s <= 0.0) return expose_at_once();
    Mosaic sum = {window_, {}};
    for (part_ = 0; part_ < kSubExposures; ++part_) {
      late_s_ = shot_.exposure_s * ((part_ + 0.5) / kSubExposures - 0.5);
      const Mosaic part = expose_at_once();
      sum.light.resize(part.light.size());
      for (size_t n = 0; n < part.light.size(); ++n) sum.light[n] += part.light[n] / kSubExposures;
    }
    return sum;
  }

 private:
  using Corners = std::array<const Node*, 4>;

  [[nodiscard]] Mosaic expose_at_once() {
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
  [[nodiscard]] std::vector<Node> nodes(int v) const {
    std::vector<Node> row;
    for (int u = window_.left; u <= window_.right + kCell; u += kCell) row.push_back(node(u, v));
    return row;
  }
  /// Traces the ray of a point of the sensor, whose rows are read while the hand moves.
  [[nodiscard]] Node node(double u, double v) const {
    const double seconds = phone_.readout_s * (v / phone_.height - 0.5) + late_s_;
    Vec3 direction = rays_.direction(Vec2{u, v} - displacement(phone_, camera_, {u, v}));
    direction += cross(turn_ * seconds, direction);
    const Vec3 eye = shot_.eye_mm + shot_.drift_mm_s * seconds;
    Node n;
    if (!(direction.z < -1e-3)) return n;
    n.in_front = true;
    const Vec2 at = *sheet_.meet(eye, direction);
    n.tangents = shifts_.in_lens({(eye.x - at.x) / eye.z, (eye.y - at.y) / eye.z});
    n.lens = sheet_.lenses_at(at, 1).coordinate;
    for (size_t c = 0; c < 3; ++c)
      n.seen[c] = Vec2{panel_.x_px(at.x), panel_.y_px(at.y)} +
                  shifts_.shift(0.0, n.tangents, c).value_or(Vec2{});
    return n;
  }

  void fill(const Corners& corners, int left, int top, std::vector<float>& light) {
    bool near = true;
    for (const Node* n : corners) near = near && n->in_front;
    PortableRandom random(shot_.seed * 1000003 + static_cast<uint64_t>(top) * 65536 +
                          static_cast<uint64_t>(left) + (uint64_t{part_} << 32));
    if (near) {
      const Vec2 tangents = (corners[0]->tangents + corners[3]->tangents) * 0.5;
      constexpr double kSteepest = 1.15;
      near = std::abs(tangents.x) < kSteepest && std::abs(tangents.y) < kSteepest;
      const Vec2 a = corners[0]->seen[1];
      constexpr double kRim = 60.0;  // pixels
      near = near && a.x > -kRim && a.y > -kRim && a.x < panel_.width_px + kRim &&
             a.y < panel_.height_px + kRim;
      if (near)
        for (size_t c = 0; c < 3; ++c) shifts_.evaluate(tangents, c, tables_[c]);
    }
    for (int j = top; j < std::min(top + kCell, window_.bottom); ++j)
      for (int i = left; i < std::min(left + kCell, window_.right); ++i) {
        const auto channel = static_cast<size_t>(mosaic_colour(camera_, i, j));
        const float seen = near ? pixel(corners, i - left, j - top, channel, random) : kWallLight;
        light[static_cast<size_t>(j - window_.top) * static_cast<size_t>(window_.width()) +
              static_cast<size_t>(i - window_.left)] = noisy(seen, i, j, random);
      }
  }

  /// Linear is a value over the square that a pixel averages, relative to a value near its middle,
  /// for which single precision is enough.
  struct Linear {
    float middle, across, down;  ///< slopes over the whole square
    [[nodiscard]] float at(float x, float y) const { return middle + across * x + down * y; }
  };
  /// Interpolates between the corners of a cell at (u, v), and keeps the whole part apart.
  Linear linear(const std::array<double, 4>& n, double u, double v, double& whole) const {
    const double blur = phone_.blur_px / kCell;
    const double right = (1.0 - v) * (n[1] - n[0]) + v * (n[3] - n[2]);
    const double down = (1.0 - u) * (n[2] - n[0]) + u * (n[3] - n[1]);
    const double middle = n[0] + u * right + v * (n[2] - n[0]);
    whole = std::floor(middle);
    return {static_cast<float>(middle - whole), static_cast<float>(blur * right),
            static_cast<float>(blur * down)};
  }

  /// Returns the light of a pixel, relative to the mean of a white panel.
  float pixel(const Corners& corners, int i, int j, size_t c, PortableRandom& random) const {
    const double u = (i + 0.5) / kCell, v = (j + 0.5) / kCell;
    const auto over_cell = [&](const auto& value, double& whole) {
      return linear(
          {value(*corners[0]), value(*corners[1]), value(*corners[2]), value(*corners[3])}, u, v,
          whole);
    };
    double lens_apex, left, top;
    const Linear lens = over_cell([](const Node& n) { return n.lens + 0.5; }, lens_apex);
    const Linear x = over_cell([c](const Node& n) { return n.seen[c].x; }, left);
    const Linear y = over_cell([c](const Node& n) { return n.seen[c].y; }, top);
    const auto haze = static_cast<float>(sheet_.sheet().haze);
    const float around = haze_[haze_block(panel_, left, top) * 3 + c];
    const float step = 1.0F / static_cast<float>(side_);
    float sum = 0.0F;
    for (int sy = 0; sy < side_; ++sy)
      for (int sx = 0; sx < side_; ++sx) {
        const uint64_t bits = random.bits();
        const auto part = [step](int n, uint64_t drawn) {  // of the square, from its middle
          constexpr uint64_t kBits = 0xffffff;
          return (static_cast<float>(n) +
                  static_cast<float>(static_cast<int>(drawn & kBits)) * 0x1p-24F) *
                     step -
                 0.5F;
        };
        const float du = part(sx, bits), dv = part(sy, bits >> 40);
        const double seen_x = left + double{x.at(du, dv)}, seen_y = top + double{y.at(du, dv)};
        if (!(seen_x >= 0.0 && seen_y >= 0.0 && seen_x < panel_.width_px &&
              seen_y < panel_.height_px)) {
          sum += kWallLight;
          continue;
        }
        // A positive number, so that its conversion rounds down.
        constexpr float kWholeLenses = 64.0F, kPlaces = ShiftTable::kPlaces;
        const auto place = static_cast<int>((lens.at(du, dv) + kWholeLenses) * kPlaces);
        const ShiftTable::Offset& o = tables_[c][static_cast<size_t>(place) % ShiftTable::kPlaces];
        const float sharp =
            std::isnan(o.x) ? around : light_at(seen_x + double{o.x}, seen_y + double{o.y}, c);
        sum += (1.0F - haze) * sharp + haze * around + static_cast<float>(shot_.room_light);
      }
    return sum / static_cast<float>(side_ * side_);
  }

  float light_at(double x, double y, size_t own) const {
    const std::optional<SubpixelId> hit = finder_.find(x, y);
    return hit ? table_[own][*hit % 4][driven_.codes[*hit]] : 0.0F;
  }

  float noisy(float light, int i, int j, PortableRandom& random) const {
    const float x = 2.0F * static_cast<float>(i) / static_cast<float>(phone_.width) - 1.0F;
    const float y = 2.0F * static_cast<float>(j) / static_cast<float>(phone_.height) - 1.0F;
    const float exposed = light * static_cast<float>(phone_.exposure) *
                          (1.0F - static_cast<float>(phone_.vignetting) * 0.5F * (x * x + y * y));
    const auto shot = static_cast<float>(phone_.shot_noise * phone_.shot_noise),
               read = static_cast<float>(phone_.read_noise * phone_.read_noise);
    const float parts = shot_.exposure_s > 0.0 ? float{kSubExposures} : 1.0F;
    return exposed +
           std::sqrt((exposed * shot + read) * parts) * noise_[random.bits() % noise_.size()];
  }

  const SheetShape& sheet_;
  const optics::Panel& panel_;
  const Phone& phone_;
  const Shot& shot_;
  int side_;             ///< samples per pixel and axis
  double late_s_ = 0.0;  ///< time after the middle of the exposure
  unsigned part_ = 0;    ///< number of the part of the exposure
  SimulatedCamera camera_;
  CameraRays rays_;
  Vec3 turn_;  ///< radians per second, panel frame
  SensorWindow window_;
  ShiftTable shifts_;
  DrivenFrame driven_;
  SubpixelFinder finder_;
  LightTable table_;
  std::vector<float> haze_, noise_;
  std::array<ShiftTable::Table, 3> tables_{};
};

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

/// Returns the codes, between 0 and 255, of equal steps of light from 0 to 1: sRGB, then an
/// S-shaped curve.
std::vector<float> code_curve(double strength) {
  std::vector<float> codes(1 << 14);
  for (size_t k = 0; k < codes.size(); ++k) {
    const double code =
        frames::srgb_from_linear(static_cast<double>(k) / static_cast<double>(codes.size() - 1));
    codes[k] = static_cast<float>(
        255.0 * (code - strength * std::sin(2.0 * std::numbers::pi * code) / std::numbers::pi));
  }
  return codes;
}

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
  Picture picture{mosaic.window.width(), mosaic.window.height(), {}};
  picture.light.resize(mosaic.light.size() * 3);
  for (int j = 0; j < picture.height; ++j)
    demosaic_row(mosaic.light, picture.width, picture.height, j, picture.at(0, j));
  map_tones(picture, hdr ? 0.5 : phone.tone_mapping);
  const std::vector<float> curve = code_curve(phone.curve);
  const auto code = [&](float light) {
    return curve[static_cast<size_t>(
        std::clamp(light, 0.0F, 1.0F) * static_cast<float>(curve.size() - 1) + 0.5F)];
  };
  for (float& value : picture.light) value = code(value);
  Photo photo;
  photo.width = phone.width;
  photo.height = phone.height;
  photo.codes.assign(static_cast<size_t>(phone.width) * static_cast<size_t>(phone.height) * 3,
                     static_cast<uint8_t>(code(kWallLight)));
  sharpen_into(picture, phone.sharpening, mosaic.window, photo);
  return photo;
}

/// Returns an APP1 segment with the orientation and the focal length on 35 mm film (EXIF 2.3).
std::string exif_segment(const Photo& photo) {
  const auto orientation = static_cast<uint8_t>(photo.orientation);
  const auto focal = static_cast<unsigned>(std::lround(photo.stated_focal_35mm));
  const auto high = static_cast<uint8_t>(focal >> 8), low = static_cast<uint8_t>(focal & 255U);
  const std::array<uint8_t, 66> bytes = {
      0xff, 0xe1, 0, 64, 'E', 'x', 'i', 'f', 0,    0,  // marker, length, name
      'M',  'M',  0, 42, 0,   0,   0,   8,   0,    2,  // big-endian; two entries at 8
      0x01, 0x12, 0, 3,  0,   0,   0,   1,   0,    orientation,
      0,    0,  // a short
      0x87, 0x69, 0, 4,  0,   0,   0,   1,   0,    0,
      0,    38,                   // the EXIF entries are at 38
      0,    0,    0, 0,  0,   1,  // no further list; one entry
      0xa4, 0x05, 0, 3,  0,   0,   0,   1,   high, low,
      0,    0,  // a short
      0,    0,    0, 0};
  return {bytes.begin(), bytes.end()};
}

}  // namespace

Photo photograph(const SheetShape& sheet, const frames::FrameView& shown, const Phone& phone,
                 const Shot& shot) {
  Photo photo = develop(Exposure(sheet, shown, phone, shot).expose(), phone, shot.hdr);
  // 35 mm film has a longer side of 36 mm.
  photo.stated_focal_35mm = std::round(36.0 * phone.focal * phone.stated_focal);
  photo.orientation = orientation_of(shot.roll_degrees);
  return photo;
}

void write_photo(const Photo& photo, int quality, const std::filesystem::path& file) {
  std::string bytes = compress_jpeg(photo.codes, photo.width, photo.height, 3, quality);
  bytes.insert(2, exif_segment(photo));  // after the marker that starts the picture
  write_text_file(file, bytes);
}

void round_trip(Photo& photo, int quality) {
  jpeg_round_trip(photo.codes, photo.width, photo.height, 3, quality);
}
}  // namespace lenticule::lab
