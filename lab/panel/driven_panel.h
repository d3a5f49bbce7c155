// SPDX-License-Identifier: Apache-2.0
// DrivenFrame simulates the driven panel: the true positions of its subpixels, the light of each
// subpixel for a frame, and how much of it an exposure during a change of frames gets.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "frames/frame.h"
#include "lab/panel/simulated_setup.h"
#include "optics/panel.h"

namespace lenticule::lab {

/// SubpixelId identifies one subpixel: pixel number (from the top left, row by row) * 4 + channel.
using SubpixelId = uint32_t;

/// SubpixelFinder finds the subpixel whose lit part contains a panel point. A subpixel of a stripe
/// panel is a third of a pixel across its stripe and a pixel along it; of a cell panel a third wide
/// and one high.
class SubpixelFinder {
 public:
  SubpixelFinder(const optics::Panel& panel, double black_matrix);
  /// Returns nothing in the black matrix and outside the panel.
  [[nodiscard]] std::optional<SubpixelId> find(double x_px, double y_px) const {
    if (!stripes_) return find_among_cells(x_px, y_px);
    if (!(x_px >= 0 && y_px >= 0 && x_px < panel_.width_px && y_px < panel_.height_px))
      return std::nullopt;
    const int i = static_cast<int>(x_px), j = static_cast<int>(y_px);
    const double across = 3.0 * (along_rows_ ? y_px - j : x_px - i);  // stripes
    const double along = along_rows_ ? x_px - i : y_px - j;
    const int stripe = std::min(2, static_cast<int>(across));
    if (std::abs(across - stripe - 0.5) > half_open_ || std::abs(along - 0.5) > half_open_)
      return std::nullopt;
    return id(i, j, reversed_ ? 2 - stripe : stripe);
  }

 private:
  /// Candidate is a subpixel that may be lit at a place: its pixel relative to that of the place.
  struct Candidate {
    int i, j, channel;
  };

  [[nodiscard]] std::optional<SubpixelId> find_among_cells(double x_px, double y_px) const;
  [[nodiscard]] bool is_lit_cell(double x_px, double y_px, int i, int j, int channel) const;
  [[nodiscard]] SubpixelId id(int i, int j, int channel) const {
    const auto width = static_cast<SubpixelId>(panel_.width_px);
    return (static_cast<SubpixelId>(j) * width + static_cast<SubpixelId>(i)) * 4 +
           static_cast<SubpixelId>(channel);
  }

  optics::Panel panel_;
  std::vector<std::vector<Candidate>> candidates_;  ///< one list per pixel of the layout's cell
  bool stripes_;            // red, green, blue or reversed, every pixel alike
  bool along_rows_;         // stripes of a panel rotated by 90 degrees
  bool reversed_;           // blue first
  double half_open_ = 0.5;  // half of the lit part, in widths and in lengths of a subpixel
};

/// DrivenFrame is a frame as the panel receives it.
struct DrivenFrame {
  std::vector<uint8_t> codes;  ///< code of each SubpixelId
};

/// Returns the codes after the link's conversion to YCbCr and back (BT.709, full range, eight
/// bits). The frame is Rgb8.
[[nodiscard]] DrivenFrame drive(const frames::FrameView& frame, Chroma chroma);

/// Overlays the panel's own logo on a frame.
void add_logo(const SimulatedPanelLink& link, const optics::Panel& panel, DrivenFrame& driven);

/// Returns the light of each code, 0 to 1.
[[nodiscard]] std::array<float, 256> light_of_codes(const SimulatedPanelLink& link);

/// Side of the squares of block_light(), in pixels; block_light() returns the mean light of the
/// squares, three channels each, row by row, and haze_block() the number of the square at a point.
inline constexpr int kHazeBlock = 32;
[[nodiscard]] uint32_t haze_block(const optics::Panel& panel, double x_px, double y_px);
[[nodiscard]] std::vector<float> block_light(const DrivenFrame& frame, const optics::Panel& panel,
                                             const std::array<float, 256>& light);

// Computes the contributions to an exposure while a panel changes its frame: the light of the old
// frame, and the mean brightness of the backlight. Times in milliseconds.

/// Returns the fraction of the light of an exposure [begin, begin + length] that belongs to the old
/// frame, for a liquid crystal that switches exponentially from `switched` on.
[[nodiscard]] double old_frame_part(double begin, double length, double switched,
                                    double time_constant);

/// Returns the mean of a square wave over the exposure, relative to its long-term mean. The wave is
/// on for the first `duty` of each period; frequency in hertz, 0 = always 1.
[[nodiscard]] double backlight_mean(double begin, double length, double hertz, double duty);
}  // namespace lenticule::lab
