// SPDX-License-Identifier: Apache-2.0
// Other people's calibrations in and out: Looking Glass visual.json (classic and cell panels) and
// CubeVi-style values. Their pitch has no distance term: an imported rig has an infinite viewing
// distance and says so in its provenance.
#pragma once

#include <string>
#include <string_view>

#include "optics/rig.h"

namespace lenticule::optics {

/// What a visual.json says about views, which is not part of our sheet.
struct LookingGlassViews {
  double view_cone_degrees = 40.0;
  bool inverted = false;
};

struct LookingGlassImport {
  Rig rig;
  LookingGlassViews views;
};

/// Values may be plain or wrapped as {"value": x}. Throws Error(Input) with "source:" and the key.
[[nodiscard]] LookingGlassImport import_looking_glass(std::string_view json,
                                                      const std::string& source);
/// Throws Error(Input) where the rig has what the format cannot say (a residual map, per-channel
/// offsets, m = 0), naming it.
[[nodiscard]] std::string export_looking_glass(const Rig& rig, const LookingGlassViews& views = {});

/// {"slope", "interval", "x0", "width", "height", optional "grid" (11x7), "pixel_order"}.
[[nodiscard]] Rig import_cubevi(std::string_view json, const std::string& source);
[[nodiscard]] std::string export_cubevi(const Rig& rig);

}  // namespace lenticule::optics
