// SPDX-License-Identifier: Apache-2.0
// Imports and exports foreign calibrations: Looking Glass visual.json (classic and cell panels) and
// CubeVi-style values. Their pitch has no distance term: an imported rig has an infinite viewing
// distance and says "effective, reference distance unknown" in its provenance.
#pragma once

#include <string>
#include <string_view>

#include "optics/rig.h"

namespace lenticule::optics {

/// LookingGlassViews holds the values of a visual.json that describe views and have no counterpart
/// in our lens sheet.
struct LookingGlassViews {
  /// Angle of one viewing zone; 0 in an export = computed from the rig's gap.
  double view_cone_degrees = 0.0;
  /// invView of the file. If true, the view fraction is 1 - fract(z), which is 1/2 - place in our
  /// terms. If false, or on panels without cells, the view fraction is fract(z), which is 1/2 +
  /// place. Real devices have invView set.
  bool inverted = true;
};

struct LookingGlassImport {
  Rig rig;
  LookingGlassViews views;
};

/// Imports a visual.json. Values may be plain or wrapped as {"value": x}. The rig's gap is chosen
/// so that a lobe is as wide as viewCone (40 degrees if the file has none). Throws Error(Input)
/// with "source:" and the key.
[[nodiscard]] LookingGlassImport import_looking_glass(std::string_view json,
                                                      const std::string& source);

/// Exports `rig` as a visual.json. A finite viewing distance is folded into the effective pitch and
/// centre that the format requires; the result is exact for refraction_shape = 1, otherwise only
/// near the panel's centre. Throws Error(Input) that names the property of the rig that the format
/// cannot express (a residual map, per-channel offsets, m = 0, pixels that are not square, a cell
/// table of another pattern).
[[nodiscard]] std::string export_looking_glass(const Rig& rig, const LookingGlassViews& views = {});

/// Imports {"slope", "interval", "x0", "width", "height", optional "pixel_order" ("rgb", "bgr"),
/// "grid" (11 x 7 values in subpixels from the top left), "pixel_mm", "kx1" (gap in subpixels)}, at
/// the top level or in "grating_params". The view fraction t of that system is 1/2 + place. Throws
/// Error(Input) with "source:" and the key.
[[nodiscard]] Rig import_cubevi(std::string_view json, const std::string& source);
/// Exports `rig` in the same way as export_looking_glass(). The format can express m = 0 and any 11
/// x 7 residual map, but not cells.
[[nodiscard]] std::string export_cubevi(const Rig& rig);

}  // namespace lenticule::optics
