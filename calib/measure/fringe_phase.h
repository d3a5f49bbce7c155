// SPDX-License-Identifier: Apache-2.0
// Measures the phase that the camera's eye sees over the panel, from fringes. A pattern of pitch p
// shows the phase theta / 2 pi = s / p - Phi_E (mod 1) at a camera pixel that sees panel point Q,
// where s is the pattern's own coordinate at Q and Phi_E the lens coordinate seen there
// (docs/panel/optics.md).
#pragma once

#include <optional>
#include <vector>

#include "calib/measure/panel_map.h"
#include "calib/measure/pattern.h"
#include "calib/measure/phase_sum.h"
#include "optics/panel.h"

namespace lenticule::calib {

/// FringeView is one set of phase-stepped fringes in camera pixels: the wave at each of `count`
/// pixels, and the panel points of the pixels from a smooth map. Borrowed.
struct FringeView {
  Fringe fringe;
  const std::vector<Complex>& waves;
  const std::vector<Vec2>& panel_px;
};

struct FringePeak {
  LinearPhase phase;
  double height = 0.0;  ///< fraction of all light that this phase explains, 0 to 1
  double second = 0.0;  ///< fraction of the next best phase, elsewhere
};

/// Returns the linear phase that explains most of the light, searched around `start` by a
/// periodogram: up to `most_fringes` more or less across the panel or from top to bottom (500
/// across and 250 down at most). Returns nothing without any light.
[[nodiscard]] std::optional<FringePeak> find_fringes(const FringeView& view,
                                                     const LinearPhase& start, double most_fringes,
                                                     const optics::Panel& panel);

/// PhaseBlock is the average over a square of camera pixels.
struct PhaseBlock {
  Vec2 camera_px;  ///< mean of its pixels
  Vec2 panel_px;   ///< smooth map at camera_px
  int pixels = 0;
  double phase = 0.0;      ///< Phi_E there, lenses; whole lenses are consistent between neighbours
  double sigma = 0.0;      ///< standard error of the phase, from the scatter inside the block
  double coherence = 0.0;  ///< 1 when all pixels agree
  double strength = 0.0;   ///< mean strength of the waves, in units of light
};

struct BlockGrid {
  int columns = 0;
  int rows = 0;
  std::vector<PhaseBlock> blocks;  ///< columns * rows; a block with pixels = 0 was not measured
};

/// Averages over squares of `block_px` camera pixels after subtracting `model`. `pixels` are
/// indices into a picture of width `picture_width`. The phase is unwrapped from block to block,
/// starting at the most coherent one.
[[nodiscard]] BlockGrid average_blocks(const FringeView& view, const std::vector<uint32_t>& pixels,
                                       int picture_width, int picture_height, int block_px,
                                       const PanelMap& map, const LinearPhase& model,
                                       const optics::Panel& panel);

/// Fits the robust weighted least-squares line through blocks.
[[nodiscard]] std::optional<LinearPhase> fit_linear(const BlockGrid& grid,
                                                    const optics::Panel& panel);

/// Returns the largest change, in lenses, of a plane fitted to the changes of the same blocks'
/// phases; 0 if no plane fits.
[[nodiscard]] double largest_change(const BlockGrid& before, BlockGrid after,
                                    const optics::Panel& panel);

}  // namespace lenticule::calib
