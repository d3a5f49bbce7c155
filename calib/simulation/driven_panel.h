// SPDX-License-Identifier: Apache-2.0
// The panel as it is driven: where its subpixels really are, and how much light each of them gives
// for a frame.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "calib/simulation/simulated_link.h"
#include "frames/frame.h"
#include "optics/panel.h"

namespace lenticule::calib {

/// Names one subpixel: pixel number (from the top left, row by row) * 4 + channel.
using SubpixelId = uint32_t;

/// Which subpixel's lit part a panel point lies in. A subpixel of a stripe panel is a third of a
/// pixel across its stripe and a pixel along it; of a cell panel a third wide and one high.
class SubpixelFinder {
 public:
  SubpixelFinder(const optics::Panel& panel, double black_matrix);
  /// None in the black matrix and beside the panel.
  [[nodiscard]] std::optional<SubpixelId> find(double x_px, double y_px) const;

 private:
  [[nodiscard]] std::optional<SubpixelId> find_among_cells(double x_px, double y_px) const;
  [[nodiscard]] bool is_lit_cell(double x_px, double y_px, int i, int j, int channel) const;
  [[nodiscard]] SubpixelId id(int i, int j, int channel) const;

  optics::Panel panel_;
  bool stripes_;            // red, green, blue or reversed, every pixel alike
  bool along_rows_;         // the stripes of a panel turned on its side
  bool reversed_;           // blue first
  double half_open_ = 0.5;  // of the lit part, in widths and in lengths of a subpixel
};

/// A frame as the panel receives it.
struct DrivenFrame {
  std::vector<uint8_t> codes;  ///< by SubpixelId
};

/// Codes after the link's way through YCbCr (BT.709, full range, eight bits). The frame is Rgb8.
[[nodiscard]] DrivenFrame drive(const frames::FrameView& frame, Chroma chroma);

/// Puts the panel's own sign over a frame.
void add_logo(const SimulatedPanelLink& link, const optics::Panel& panel, DrivenFrame& driven);

/// Light of each code, 0 to 1.
[[nodiscard]] std::array<float, 256> light_of_codes(const SimulatedPanelLink& link);

/// Mean light of squares of kHazeBlock pixels, three channels each, row by row.
inline constexpr int kHazeBlock = 32;
[[nodiscard]] std::vector<float> block_light(const DrivenFrame& frame, const optics::Panel& panel,
                                             const std::array<float, 256>& light);

}  // namespace lenticule::calib
