// SPDX-License-Identifier: Apache-2.0
// Implements the bench: one clock, the last two frames, and their pictures from the present
// viewpoint.
#include "lab/panel/simulated_bench.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "base/parallel_rows.h"
#include "lab/panel/driven_panel.h"
#include "lab/panel/lens_sheet.h"
#include "lab/panel/portable_random.h"
#include "lab/panel/sample_map.h"
#include "lab/panel/simulated_sensor.h"

namespace lenticule::lab {
namespace {

using calib::CameraFacts;
using calib::GrabStatus;
using calib::Nanoseconds;

constexpr double kNanosecondsPerMs = 1e6;
constexpr double kForgotten = 1e-5;  // smaller remainders of an old frame are ignored
constexpr int kBandPeriodRows = 90;

double ms_of(Nanoseconds time) {
  return static_cast<double>(time.count()) / kNanosecondsPerMs;
}
Nanoseconds nanoseconds_of_ms(double ms) {
  return Nanoseconds(std::llround(ms * kNanosecondsPerMs));
}

/// Returns the panel with its true layout. Throws Error(Input) for an impossible set-up.
optics::Panel checked_panel(optics::Panel panel, const SimulatedSheet& sheet,
                            const SimulatedPanelLink& link, const SimulatedCamera& camera) {
  check_sheet(sheet, panel);
  check_link(link);
  check_camera(camera);
  if (link.actual_layout) panel.layout = *link.actual_layout;
  return panel;
}

CameraFacts facts_of(const SimulatedCamera& camera) {
  CameraFacts facts;
  facts.name = "simulated camera";
  facts.width = camera.width;
  facts.height = camera.height;
  facts.channels = camera.bayer ? 3 : 1;
  facts.frames_per_second = camera.frames_per_second;
  facts.pixel_format = "simulated";
  if (camera.gain_drift > 0.0) facts.unlocked.emplace_back("no manual exposure");
  return facts;
}

}  // namespace

SimulatedBench::SimulatedBench(const optics::Panel& panel, const SimulatedSheet& sheet,
                               const SimulatedPanelLink& link, const SimulatedCamera& camera,
                               uint64_t seed)
    : panel_(checked_panel(panel, sheet, link, camera)),
      sheet_(sheet),
      link_(link),
      camera_(camera),
      seed_(seed),
      shape_(panel_, sheet, 0.0),
      finder_(panel_, sheet.black_matrix),
      sensor_(camera, scramble(seed + 1)),
      facts_(facts_of(camera)),
      code_light_(light_of_codes(link)),
      table_(light_table(camera, code_light_, 1.0 - sheet.black_matrix)),
      camera_starts_ms_(PortableRandom(seed).uniform(0.0, 1000.0 / camera.frames_per_second)) {
  const frames::WovenFrame black(geometry());
  current_.driven = drive(black.view(), Chroma::Full);
  previous_.driven = current_.driven;
  // Hits of a mosaic pixel's own colour count in every copy.
  if (camera.bayer)
    for (size_t own = 0; own < 3; ++own)
      for (float& light : table_[own][own]) light /= static_cast<float>(kMosaicCopies);
}

frames::FrameGeometry SimulatedBench::geometry() const {
  return {panel_.width_px, panel_.height_px, frames::PixelFormat::Rgb8};
}

void SimulatedBench::forget_viewpoint() {
  map_.reset();
  current_.light.clear();
  previous_.light.clear();
}

void SimulatedBench::move_camera(Vec3 position_mm, Vec3 look_at_mm, double roll_degrees) {
  SimulatedCamera moved = camera_;
  moved.position_mm = position_mm;
  moved.look_at_mm = look_at_mm;
  moved.roll_degrees = roll_degrees;
  check_camera(moved);
  camera_ = moved;
  forget_viewpoint();
}

void SimulatedBench::set_thermal_stretch(double relative) {
  if (!(std::abs(relative) <= 0.1)) {
    throw Error(ErrorKind::Input, "simulated sheet: thermal stretch: out of range",
                "it must be -0.1 to 0.1");
  }
  shape_ = SheetShape(panel_, sheet_, relative);
  forget_viewpoint();
}

/// Adds to the current frame what a slow panel still shows of the previous one.
void SimulatedBench::keep_leftover_of_old_frame(double ms_since_shown) {
  if (current_.light.empty() || previous_.light.empty() || link_.response_ms <= 0.0) return;
  const auto left = static_cast<float>(std::exp(-ms_since_shown / link_.response_ms));
  if (double{left} < kForgotten) return;
  for (size_t i = 0; i < current_.light.size(); ++i) {
    current_.light[i] += (previous_.light[i] - current_.light[i]) * left;
  }
}

frames::ShowResult SimulatedBench::show(const frames::FrameView& frame,
                                        std::chrono::nanoseconds timeout) {
  LENTICULE_CHECK(frame.geometry == geometry());
  const double period_ms = 1000.0 / link_.refresh_hz;
  const double vblank_ms = (std::floor(ms_of(now_) / period_ms + 1e-6) + 1.0) * period_ms;
  const Nanoseconds vblank = nanoseconds_of_ms(vblank_ms);
  if (vblank - now_ > timeout) {
    now_ += std::max(timeout, Nanoseconds(0));
    return frames::ShowResult::TimedOut;
  }
  keep_leftover_of_old_frame(vblank_ms - shown_at_ms_);
  std::swap(previous_, current_);
  current_.driven = drive(frame, link_.chroma);
  add_logo(link_, panel_, current_.driven);
  current_.light.clear();
  now_ = vblank;
  shown_at_ms_ = vblank_ms;
  ++shown_frames_;
  if (camera_.shake_mm > 0.0) forget_viewpoint();
  return frames::ShowResult::Shown;
}

void SimulatedBench::trace_if_needed() {
  if (map_) return;
  SimulatedCamera shaken = camera_;
  if (camera_.shake_mm > 0.0) {
    PortableRandom random(seed_ ^ scramble(shown_frames_));
    const Vec3 moved{random.gaussian(), random.gaussian(), random.gaussian()};
    shaken.position_mm += moved * camera_.shake_mm;
    shaken.position_mm.z = std::max(shaken.position_mm.z, 1.0);
  }
  map_ =
      std::make_unique<SampleMap>(panel_, shape_, finder_, shaken, scramble(seed_ + 2), threads_);
}

const std::vector<float>& SimulatedBench::light_of(ShownFrame& frame) {
  trace_if_needed();
  if (frame.light.empty()) {
    Haze haze{sheet_.haze, 1.0 - sheet_.black_matrix, {}};
    if (haze.part > 0.0) haze.blocks = block_light(frame.driven, panel_, code_light_);
    map_->gather(frame.driven, table_, haze, frame.light, threads_);
  }
  return frame.light;
}

double SimulatedBench::start_of_picture_ms(uint64_t picture) const {
  return camera_starts_ms_ + static_cast<double>(picture) * 1000.0 / camera_.frames_per_second;
}

double SimulatedBench::length_of_picture_ms() const {
  return camera_.exposure_ms + camera_.rolling_shutter_ms;
}

/// Returns the first picture that ends after now and was not taken yet.
uint64_t SimulatedBench::next_picture() const {
  const double earliest_start = ms_of(now_) - length_of_picture_ms() - camera_starts_ms_;
  const double number = std::floor(earliest_start * camera_.frames_per_second / 1000.0) + 1.0;
  return std::max(pictures_, static_cast<uint64_t>(std::max(0.0, number)));
}

GrabStatus SimulatedBench::grab(calib::CameraPicture& out, Nanoseconds timeout,
                                Nanoseconds not_before) {
  const Nanoseconds deadline = now_ + std::max(timeout, Nanoseconds(0));
  while (true) {
    if (pictures_left_ == 0) return GrabStatus::Gone;
    const uint64_t picture = next_picture();
    const double start_ms = start_of_picture_ms(picture);
    const Nanoseconds end = nanoseconds_of_ms(start_ms + length_of_picture_ms());
    if (end > deadline) {
      now_ = deadline;
      return GrabStatus::TimedOut;
    }
    now_ = std::max(now_, end);
    pictures_ = picture + 1;
    if (pictures_left_ > 0) --pictures_left_;
    out.sequence = picture;
    out.time = nanoseconds_of_ms(start_ms + length_of_picture_ms() / 2.0);
    if (out.time < not_before) continue;
    expose(picture);
    sensor_.develop(exposed_, picture, out, threads_);
    return GrabStatus::Ready;
  }
}

double SimulatedBench::row_begins_ms(int row, uint64_t picture) const {
  return start_of_picture_ms(picture) + camera_.rolling_shutter_ms * row / camera_.height;
}

double SimulatedBench::old_part_of_row(int row, uint64_t picture) const {
  const double switched = shown_at_ms_ + link_.scan_out_ms * map_->row(row).panel_y;
  return old_frame_part(row_begins_ms(row, picture), camera_.exposure_ms, switched,
                        link_.response_ms);
}

double SimulatedBench::gain_of_row(int row, uint64_t picture) const {
  PortableRandom random(scramble(seed_ + 3) ^ picture);
  const double drift = 1.0 + camera_.gain_drift * random.gaussian();
  const double phase = random.uniform(0.0, 2.0 * std::numbers::pi);
  const double wave = std::sin(2.0 * std::numbers::pi * row / kBandPeriodRows + phase);
  return std::max(0.0, drift) * (1.0 + camera_.row_banding * wave) *
         backlight_mean(row_begins_ms(row, picture), camera_.exposure_ms, link_.pwm_hz,
                        link_.pwm_duty);
}

void SimulatedBench::expose(uint64_t picture) {
  light_of(current_);
  bool both_frames = false;
  for (int row = 0; row < camera_.height && !both_frames; ++row) {
    both_frames = old_part_of_row(row, picture) > kForgotten;
  }
  if (both_frames) light_of(previous_);
  exposed_.resize(current_.light.size());
  const auto expose_one = [&](int row) {
    expose_row(row, picture, both_frames);
    if (camera_.highlight_half_width > 0.0) add_highlight(row);
  };
  for_rows(camera_.height, expose_one, threads_);
}

void SimulatedBench::expose_row(int row, uint64_t picture, bool both_frames) {
  const size_t first = static_cast<size_t>(row) * static_cast<size_t>(camera_.width);
  const size_t last = first + static_cast<size_t>(camera_.width);
  const auto old_part = static_cast<float>(both_frames ? old_part_of_row(row, picture) : 0.0);
  const auto gain = static_cast<float>(gain_of_row(row, picture));
  const auto ambient = static_cast<float>(camera_.ambient);
  for (size_t i = first; i < last; ++i) {
    const float now = current_.light[i];
    const float light = both_frames ? now + (previous_.light[i] - now) * old_part : now;
    exposed_[i] = light * gain + ambient;
  }
}

/// Adds the reflection: twice full scale inside, decreasing to zero over a tenth of the half axes.
void SimulatedBench::add_highlight(int row) {
  const double y = ((row + 0.5) / camera_.height - camera_.highlight_y) /
                   std::max(camera_.highlight_half_height, 1e-6);
  if (std::abs(y) > 1.1) return;
  float* values = &exposed_[static_cast<size_t>(row) * static_cast<size_t>(camera_.width)];
  for (int column = 0; column < camera_.width; ++column) {
    const double x =
        ((column + 0.5) / camera_.width - camera_.highlight_x) / camera_.highlight_half_width;
    const double inside = std::clamp((1.1 - std::hypot(x, y)) * 10.0, 0.0, 1.0);
    values[column] += static_cast<float>(2.0 * inside);
  }
}

double SimulatedBench::ground_truth_phase(double x_px, double y_px, int channel, Vec3 eye,
                                          LightMiddle middle) const {
  const optics::Panel& panel = panel_;
  const Vec2 point{panel.x_mm(x_px), panel.y_mm(y_px)};
  const std::optional<TrueView> view = true_view(shape_, point, channel, eye, middle);
  return view ? view->phase : std::numeric_limits<double>::quiet_NaN();
}

std::optional<Vec2> SimulatedBench::ground_truth_in_picture(double x_px, double y_px) const {
  const optics::Panel& panel = panel_;
  const SimulatedCamera& camera = camera_;
  const Vec2 point{panel.x_mm(x_px), panel.y_mm(y_px)};
  const std::optional<TrueView> view =
      true_view(shape_, point, 1, camera.position_mm, LightMiddle::Centroid);
  if (!view) return std::nullopt;
  return CameraRays(camera).project(view->aim);
}

}  // namespace lenticule::lab
