// SPDX-License-Identifier: Apache-2.0
// SampleMap holds the subpixels that each camera pixel sees from one viewpoint: traced once, after
// which every frame's picture is a sum over table entries.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "lab/panel/driven_panel.h"
#include "lab/panel/lens_sheet.h"
#include "lab/panel/simulated_sensor.h"
#include "lab/panel/simulated_setup.h"

namespace lenticule::lab {

/// Number of copies of every ray of a mosaic pixel, moved along the lens, which is uniform along
/// its axis. Without copies most rays would be lost on the two other colours, and white would look
/// coarse. Rays that hit another colour than the pixel's are kept only once.
inline constexpr size_t kMosaicCopies = 6;

/// SampleRow holds the samples of one camera row.
struct SampleRow {
  int first = 0;  ///< column of the first pixel that sees the panel
  std::vector<uint16_t>
      lit;  ///< number of lit subpixels that each pixel, counted from `first`, sees
  std::vector<float> scale;           ///< vignetting over number of samples, for each pixel
  std::vector<uint32_t> haze_block;   ///< block around each pixel (block_light)
  std::vector<SubpixelId> subpixels;  ///< subpixels of all pixels, one after the other
  double panel_y =
      0.5;  ///< mean height on the panel of the points that the row sees, 0 top, 1 bottom
};

/// Haze is scattered light: it reaches the camera from the neighbourhood instead of straight
/// through the lens.
struct Haze {
  double part = 0.0;
  double lit_area = 1.0;      ///< lit fraction of the panel, without the black matrix
  std::vector<float> blocks;  ///< block_light
};

class SampleMap {
 public:
  /// Traces the whole picture with `threads` helpers; the result does not depend on their number.
  SampleMap(const optics::Panel& true_panel, const SheetShape& shape, const SubpixelFinder& finder,
            const SimulatedCamera& camera, uint64_t seed, int threads);

  [[nodiscard]] const SampleRow& row(int row) const { return rows_[static_cast<size_t>(row)]; }

  /// Computes the light of the camera's pixels, row by row, one value each in the pixel's own
  /// colour; 0 for pixels that do not see the panel.
  void gather(const DrivenFrame& frame, const LightTable& table, const Haze& haze,
              std::vector<float>& light, int threads) const;

 private:
  void gather_row(int row, const DrivenFrame& frame, const LightTable& table, float* light) const;
  void mix_haze(int row, const Haze& haze, const LightTable& table, float* light) const;

  SimulatedCamera camera_;
  std::vector<SampleRow> rows_;
};

}  // namespace lenticule::lab
