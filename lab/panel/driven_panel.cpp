// SPDX-License-Identifier: Apache-2.0
// Converts code values to the light of single subpixels, now and while the panel changes its frame.
#include "lab/panel/driven_panel.h"

#include <algorithm>
#include <cmath>

#include "frames/srgb.h"

namespace lenticule::lab {

namespace {

bool named(const optics::Panel& panel, const char* a, const char* b) {
  return panel.layout.name() == a || panel.layout.name() == b;
}

uint8_t rounded(double code) {
  return static_cast<uint8_t>(std::lround(std::clamp(code, 0.0, 255.0)));
}

struct Ycc {
  double y = 0.0;
  double cb = 0.0;
  double cr = 0.0;
};

constexpr double kRed = 0.2126;
constexpr double kBlue = 0.0722;
constexpr double kGreen = 1.0 - kRed - kBlue;

Ycc ycc_of(const uint8_t* rgb) {
  const double y = kRed * rgb[0] + kGreen * rgb[1] + kBlue * rgb[2];
  return {y, (rgb[2] - y) / (2.0 - 2.0 * kBlue), (rgb[0] - y) / (2.0 - 2.0 * kRed)};
}

void write_rgb(const Ycc& c, uint8_t* codes) {
  const double y = std::round(c.y);
  const double cb = std::round(c.cb);
  const double cr = std::round(c.cr);
  const double red = y + (2.0 - 2.0 * kRed) * cr;
  const double blue = y + (2.0 - 2.0 * kBlue) * cb;
  codes[0] = rounded(red);
  codes[1] = rounded((y - kRed * red - kBlue * blue) / kGreen);
  codes[2] = rounded(blue);
}

/// Averages the chroma of a block of `wide` by `high` pixels from (i, j).
void share_chroma(const frames::FrameView& frame, int i, int j, int wide, int high,
                  DrivenFrame& driven) {
  const int right = std::min(i + wide, frame.geometry.width);
  const int bottom = std::min(j + high, frame.geometry.height);
  Ycc mean;
  for (int row = j; row < bottom; ++row) {
    for (int column = i; column < right; ++column) {
      const Ycc c = ycc_of(frame.row(row) + static_cast<size_t>(column) * 3);
      mean.cb += c.cb / ((right - i) * (bottom - j));
      mean.cr += c.cr / ((right - i) * (bottom - j));
    }
  }
  for (int row = j; row < bottom; ++row) {
    for (int column = i; column < right; ++column) {
      const Ycc own = ycc_of(frame.row(row) + static_cast<size_t>(column) * 3);
      const size_t pixel = static_cast<size_t>(row) * static_cast<size_t>(frame.geometry.width) +
                           static_cast<size_t>(column);
      write_rgb({own.y, mean.cb, mean.cr}, &driven.codes[pixel * 4]);
    }
  }
}

void copy_codes(const frames::FrameView& frame, DrivenFrame& driven) {
  const size_t pixels = driven.codes.size() / 4;
  for (size_t pixel = 0; pixel < pixels; ++pixel) {
    const uint8_t* from = &frame.bytes[pixel * 3];
    std::copy(from, from + 3, &driven.codes[pixel * 4]);
  }
}

}  // namespace

SubpixelFinder::SubpixelFinder(const optics::Panel& panel, double black_matrix)
    : panel_(panel),
      stripes_(panel.layout.name() != "cells"),
      along_rows_(named(panel, "vrgb", "vbgr")),
      reversed_(named(panel, "bgr", "vbgr")) {
  half_open_ = std::sqrt(1.0 - black_matrix) / 2.0;
  if (stripes_) return;
  // Offsets of cells reach two pixels to either side: of all subpixels around a pixel, those whose
  // lit part reaches into it are kept.
  constexpr int kReach = 3;
  const int columns = panel.layout.columns(), rows = panel.layout.rows();
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      std::vector<Candidate>& near = candidates_.emplace_back();
      for (int j = -kReach; j <= kReach; ++j)
        for (int i = -kReach; i <= kReach; ++i)
          for (int channel = 0; channel < 3; ++channel) {
            // Whole periods of the layout away, indices are not negative.
            const Vec2 off = panel.subpixel_centre_px(column + i + kReach * columns,
                                                      row + j + kReach * rows, channel) -
                             Vec2{column + kReach * columns + 0.5, row + kReach * rows + 0.5};
            if (std::abs(off.x) <= 0.5 + half_open_ / 3.0 && std::abs(off.y) <= 0.5 + half_open_)
              near.push_back({i, j, channel});
          }
    }
}

bool SubpixelFinder::is_lit_cell(double x_px, double y_px, int i, int j, int channel) const {
  const Vec2 centre = panel_.subpixel_centre_px(i, j, channel);
  return std::abs(x_px - centre.x) <= half_open_ / 3.0 && std::abs(y_px - centre.y) <= half_open_;
}

std::optional<SubpixelId> SubpixelFinder::find_among_cells(double x_px, double y_px) const {
  if (!(std::abs(x_px) < 1e6 && std::abs(y_px) < 1e6)) return std::nullopt;
  const int i = static_cast<int>(std::floor(x_px)), j = static_cast<int>(std::floor(y_px));
  const int columns = panel_.layout.columns(), rows = panel_.layout.rows();
  const auto part = [](int at, int count) { return (at % count + count) % count; };
  for (const Candidate& c :
       candidates_[static_cast<size_t>(part(j, rows) * columns + part(i, columns))]) {
    const int column = i + c.i, row = j + c.j;
    if (column >= 0 && row >= 0 && column < panel_.width_px && row < panel_.height_px &&
        is_lit_cell(x_px, y_px, column, row, c.channel))
      return id(column, row, c.channel);
  }
  return std::nullopt;
}

DrivenFrame drive(const frames::FrameView& frame, Chroma chroma) {
  DrivenFrame driven;
  const int width = frame.geometry.width;
  const int height = frame.geometry.height;
  driven.codes.resize(static_cast<size_t>(width) * static_cast<size_t>(height) * 4);
  if (chroma == Chroma::Full) {
    copy_codes(frame, driven);
    return driven;
  }
  const int high = chroma == Chroma::HalfBoth ? 2 : 1;
  for (int j = 0; j < height; j += high) {
    for (int i = 0; i < width; i += 2) share_chroma(frame, i, j, 2, high, driven);
  }
  return driven;
}

void add_logo(const SimulatedPanelLink& link, const optics::Panel& panel, DrivenFrame& driven) {
  const auto pixels = [](double part, int count) {
    return std::min(count, static_cast<int>(std::lround(part * count)));
  };
  const int left = pixels(link.logo_left, panel.width_px);
  const int right = pixels(link.logo_left + link.logo_width, panel.width_px);
  const int bottom = pixels(link.logo_top + link.logo_height, panel.height_px);
  const auto width = static_cast<size_t>(panel.width_px);
  for (int j = pixels(link.logo_top, panel.height_px); j < bottom; ++j) {
    uint8_t* row = &driven.codes[static_cast<size_t>(j) * width * 4];
    std::fill(row + static_cast<ptrdiff_t>(left) * 4, row + static_cast<ptrdiff_t>(right) * 4,
              uint8_t{255});
  }
}

std::array<float, 256> light_of_codes(const SimulatedPanelLink& link) {
  std::array<float, 256> light{};
  for (size_t code = 0; code < light.size(); ++code) {
    const double encoded = static_cast<double>(code) / 255.0;
    light[code] =
        static_cast<float>(link.eotf_exponent > 0.0 ? std::pow(encoded, link.eotf_exponent)
                                                    : frames::linear_from_srgb(encoded));
  }
  return light;
}

uint32_t haze_block(const optics::Panel& panel, double x_px, double y_px) {
  const auto x = static_cast<int>(std::clamp(x_px, 0.0, panel.width_px - 1.0));
  const auto y = static_cast<int>(std::clamp(y_px, 0.0, panel.height_px - 1.0));
  const int columns = (panel.width_px + kHazeBlock - 1) / kHazeBlock;
  return static_cast<uint32_t>(y / kHazeBlock * columns + x / kHazeBlock);
}

std::vector<float> block_light(const DrivenFrame& frame, const optics::Panel& panel,
                               const std::array<float, 256>& light) {
  const int columns = (panel.width_px + kHazeBlock - 1) / kHazeBlock;
  const int rows = (panel.height_px + kHazeBlock - 1) / kHazeBlock;
  std::vector<float> sums(static_cast<size_t>(columns) * static_cast<size_t>(rows) * 3);
  std::vector<float> pixels(sums.size() / 3);
  for (int j = 0; j < panel.height_px; ++j) {
    for (int i = 0; i < panel.width_px; ++i) {
      const size_t block = static_cast<size_t>(j / kHazeBlock) * static_cast<size_t>(columns) +
                           static_cast<size_t>(i / kHazeBlock);
      const size_t pixel =
          static_cast<size_t>(j) * static_cast<size_t>(panel.width_px) + static_cast<size_t>(i);
      const uint8_t* codes = &frame.codes[pixel * 4];
      for (size_t c = 0; c < 3; ++c) sums[block * 3 + c] += light[codes[c]];
      pixels[block] += 1.0F;
    }
  }
  for (size_t value = 0; value < sums.size(); ++value) sums[value] /= pixels[value / 3];
  return sums;
}

// Computes integrals over one exposure.

namespace {

/// Returns the integral from 0 to t of exp(-t / tau).
double decay_until(double t, double time_constant) {
  if (time_constant <= 0.0) return 0.0;
  return -time_constant * std::expm1(-t / time_constant);
}

/// Returns the integral from 0 to t of the square wave; t in periods.
double lit_until(double t, double duty) {
  const double whole = std::floor(t);
  return whole * duty + std::min(t - whole, duty);
}

}  // namespace

double old_frame_part(double begin, double length, double switched, double time_constant) {
  const double from = std::max(begin, switched) - switched;
  const double to = std::max(begin + length, switched) - switched;
  const double before = std::clamp(switched - begin, 0.0, length);
  return (before + decay_until(to, time_constant) - decay_until(from, time_constant)) / length;
}

double backlight_mean(double begin, double length, double hertz, double duty) {
  if (hertz <= 0.0) return 1.0;
  const double from = begin * hertz / 1000.0;
  const double to = from + length * hertz / 1000.0;
  return (lit_until(to, duty) - lit_until(from, duty)) / ((to - from) * duty);
}
}  // namespace lenticule::lab
