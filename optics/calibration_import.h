// SPDX-License-Identifier: Apache-2.0
// Other people's calibrations in and out: Looking Glass visual.json (classic and cell panels) and
// CubeVi-style values. Their pitch has no distance term: an imported rig has an infinite viewing
// distance and says "effective, reference distance unknown" in its provenance.
#pragma once

#include <string>
#include <string_view>

#include "optics/rig.h"

namespace lenticule::optics {

/// What a visual.json says about views, which is not part of our sheet.
struct LookingGlassViews {
  /// Angle of one viewing zone; 0 in an export = what the rig's gap says.
  double view_cone_degrees = 0.0;
  /// invView: the view fraction is 1 - fract(z), which is 1/2 - place in our terms; without it, and
  /// on panels without cells, it is fract(z), 1/2 + place. Real devices have it set.
  bool inverted = true;
};

struct LookingGlassImport {
  Rig rig;
  LookingGlassViews views;
};

/// Values may be plain or wrapped as {"value": x}. The gap is what makes a lobe as wide as viewCone
/// (40 degrees if there is none). Throws Error(Input) with "source:" and the key.
[[nodiscard]] LookingGlassImport import_looking_glass(std::string_view json,
                                                      const std::string& source);

/// A finite viewing distance becomes the effective pitch and centre that the format means, exact
/// for refraction_shape = 1 and near the panel's centre otherwise. Throws Error(Input) where the
/// rig has what the format cannot say (a residual map, per-channel offsets, m = 0, pixels that are
/// not square, a cell table of another pattern), naming it.
[[nodiscard]] std::string export_looking_glass(const Rig& rig, const LookingGlassViews& views = {});

/// {"slope", "interval", "x0", "width", "height", optional "pixel_order" ("rgb", "bgr"), "grid"
/// (11 x 7 values in subpixels from the top left), "pixel_mm", "kx1" (gap in subpixels)}, at the
/// top or in "grating_params". The view fraction t of that system is 1/2 + place.
[[nodiscard]] Rig import_cubevi(std::string_view json, const std::string& source);
/// As export_looking_glass; m = 0 and any 11 x 7 residual map can be said, cells cannot.
[[nodiscard]] std::string export_cubevi(const Rig& rig);

}  // namespace lenticule::optics
