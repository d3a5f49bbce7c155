// SPDX-License-Identifier: Apache-2.0
// The fringes of a photographed chart, block by block.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "calib/photo/photo_pose.h"
#include "calib/photo/tag_chart.h"
#include "calib/photo/tag_finder.h"

namespace lenticule::calib {

/// Lens coordinate over the sheet without its residual map: at + across x + down y with
/// x = (L_x - W/2) / W and y = (L_y - H/2) / H.
struct LensPlane {
  double at = 0.0;      ///< phi0
  double across = 0.0;  ///< 3 W / P
  double down = 0.0;    ///< 3 m H / P
};
[[nodiscard]] LensPlane plane_of(const optics::Rig& rig);
/// The rig with the plane's pitch, slant and offset.
[[nodiscard]] optics::Rig with_plane(optics::Rig rig, const LensPlane& plane);

/// A pixel that sees fringes. Single precision: its rounding is below 1e-4 lens and differs from
/// pixel to pixel.
struct FringeSample {
  float x = 0.0F;  ///< place on the lens plane as LensPlane has it
  float y = 0.0F;
  float panel_x_px = 0.0F;
  float panel_y_px = 0.0F;
  float light = 0.0F;
  uint32_t block = 0;
};

/// Blocks in rows and columns over the panel, each within one band.
struct FringeSamples {
  int columns = 0;
  int rows = 0;
  std::vector<FringeSample> samples;
  double saturated = 0.0;  ///< part of the pixels on the panel that were clipped, and left out
  double covered = 0.0;    ///< part of the panel's fringes that the picture shows

  [[nodiscard]] int band_of(uint32_t block, int bands) const {
    return static_cast<int>(block) / columns * bands / rows;
  }
};

/// The pixels that look at fringes: not at tags, nor near the border of a band.
[[nodiscard]] FringeSamples collect_fringes(const PhotoLight& picture, const PhotoPose& pose,
                                            const SinglePhotoChart& chart);

/// The light of the chart's squares of one pixel, part of that of the grey beside them, the lesser
/// of the patches; empty where none is seen.
[[nodiscard]] std::optional<double> light_of_squares(const PhotoLight& picture,
                                                     const PhotoPose& pose,
                                                     const SinglePhotoChart& chart);

/// How the fringes of one block differ from those that a lens plane predicts.
struct FringeBlock {
  uint32_t block = 0;
  double detuning = 1.0;  ///< d of its band
  double x = 0.0;         ///< mean place, as LensPlane has it
  double y = 0.0;
  double phase = 0.0;     ///< fringes seen minus predicted, cycles in [-1/2, 1/2]
  double contrast = 0.0;  ///< amplitude over mean light
  double weight = 0.0;    ///< grows with what is known about the phase
};

/// Least squares of light over mean, slopes, cosine and sine for each block with enough pixels, by
/// which neither uneven light nor broken fringes bias the phase. A block that is too small for its
/// fringes to be told from uneven light is none. `rig` has the residual map.
[[nodiscard]] std::vector<FringeBlock> measure_blocks(const FringeSamples& fringes,
                                                      const SinglePhotoChart& chart,
                                                      const optics::Rig& rig);

}  // namespace lenticule::calib
