// SPDX-License-Identifier: Apache-2.0
// Rig describes one panel, the lens sheet on it and the expected viewing line. Plain data;
// optics/model.h has the formulas, optics/rig_file.h the file format.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "optics/panel.h"
#include "optics/units.h"

namespace lenticule::optics {

/// ResidualMap holds the deviations of the sheet from a perfect grating: a grid of lens-coordinate
/// residuals over the whole panel (first column at the left edge, last at the right; rows from the
/// top down), smooth between its knots (bicubic Catmull-Rom, linear extrapolation at the border).
/// Empty = no deviations.
struct ResidualMap {
  int columns = 0;
  int rows = 0;
  std::vector<double> lenses;  ///< rows * columns values, row by row

  [[nodiscard]] bool empty() const { return lenses.empty(); }
  friend bool operator==(const ResidualMap&, const ResidualMap&) = default;
};

/// LensSheet holds the results of a calibration, which contain no viewing distance.
struct LensSheet {
  Subpixels pitch{0};             ///< P: lens pitch along a pixel row
  double slant = 0.0;             ///< m: an apex line moves LEFT by m pixels per row down
  Lenses offset{0};               ///< phi0: lens coordinate at the panel centre
  Millimetres gap{0};             ///< g: reduced gap, sum of t_i / n_i
  double refraction_shape = 1.0;  ///< nu = D3 / D1; 1/n^2 for one slab, 1 for air
  std::array<Subpixels, 3> channel_offset{};  ///< dx_c relative to G
  ResidualMap residual;                       ///< dL
  /// The lens spot: the blur of a micro-image for an eye. Gaussian sigma in lenses.
  Lenses spot_sigma{0.04};
  friend bool operator==(const LensSheet&, const LensSheet&) = default;
};

/// ViewingLine is the design eye line y = height, z = distance, with the viewer's place on it. It
/// belongs to the installation, not to the sheet.
struct ViewingLine {
  Millimetres height{0};                                          ///< Ey
  Millimetres distance{std::numeric_limits<double>::infinity()};  ///< Z; infinite = parallel lobes
  Millimetres centre{0};  ///< Ex0: x of the viewer; 0 is in front of the panel's centre
  friend bool operator==(const ViewingLine&, const ViewingLine&) = default;
};

/// PanelIdentity identifies the physical panel of a rig. Empty members match any panel.
struct PanelIdentity {
  std::string manufacturer;  ///< three letters
  std::optional<uint32_t> product;
  std::string serial;
  std::string edid_sha256;  ///< SHA-256 of the 128-byte base block, hexadecimal

  [[nodiscard]] bool empty() const {
    return manufacturer.empty() && !product && serial.empty() && edid_sha256.empty();
  }
  friend bool operator==(const PanelIdentity&, const PanelIdentity&) = default;
};

struct Rig {
  std::string name;
  Panel panel;
  LensSheet sheet;
  ViewingLine viewing;
  PanelIdentity identity;
  /// Origin of the numbers (key, text), in file order: date, tool, camera, source, ...
  std::vector<std::pair<std::string, std::string>> provenance;

  friend bool operator==(const Rig&, const Rig&) = default;
};

/// Limits for rigs from outside, checked by validate_rig().
inline constexpr int kMaxPanelPixels = 32768;  ///< limit per side
inline constexpr double kMinPitchSubpixels = 1.5;
inline constexpr double kMaxPitchSubpixels = 3000.0;
inline constexpr double kMaxSlant = 4.0;

inline constexpr int kMaxResidualKnots = 256;  ///< limit per side
/// A residual map may change the local pitch by at most this fraction of the pitch.
inline constexpr double kMaxResidualSlope = 0.1;

/// RigProblem describes an invalid rig: the key in the rig file ("sheet.pitch_subpx"), the cause
/// and the remedy.
struct RigProblem {
  std::string key;
  std::string cause;
  std::string remedy;
};

/// Returns the first member that is non-finite, out of range or contradictory, if any. A rig
/// without a problem has a finite ray for every subpixel.
[[nodiscard]] std::optional<RigProblem> find_problem(const Rig& rig);

/// Throws Error(Input) "context: key: cause" if there is a problem; `context` is a file name.
void validate_rig(const Rig& rig, const std::string& context);

/// Returns 16 hexadecimal digits computed from all members that change pixels (panel, sheet and
/// viewing line, but not name, identity or provenance). Equal rigs have equal fingerprints on every
/// machine.
[[nodiscard]] std::string fingerprint(const Rig& rig);

// turned_rig computes the rig of a panel that is hung in another way than the one in which it was
// measured.

/// Returns the rig for a viewer who sees the panel with this mounting. The panel, its sheet and its
/// residual map are turned from rig.panel.mounting; the viewing line, which belongs to the viewer,
/// stays. Every phase is kept except for its sign and rounding (in a quarter turn of a sheet with a
/// residual map, the map is read at points that differ by the channel offsets). Throws Error(Input)
/// if the lenses would lie across the viewer's eyes: beyond the slants that a rig can have.
[[nodiscard]] Rig turned_rig(const Rig& rig, const Mounting& mounting);

/// Returns the layout of a panel of size `sent` as seen with this mounting.
[[nodiscard]] SubpixelLayout turned_layout(const SubpixelLayout& layout, const Mounting& mounting,
                                           PixelGrid sent);

// EffectiveSheet describes a sheet for systems without a viewing distance: the distance is folded
// into pitch and offset.

struct EffectiveSheet {
  Subpixels pitch;
  Lenses offset;
};

/// Returns the effective sheet of a rig. Paraxially, the eye at (Ex0, Ey, Z) sees the phase
/// 3 (x + m y) / (P (1 + g/Z)) + offset', so the slant does not change.
[[nodiscard]] inline EffectiveSheet effective_sheet(const Rig& rig) {
  const LensSheet& sheet = rig.sheet;
  const double z = rig.viewing.distance.value;
  if (std::isinf(z)) return {sheet.pitch, sheet.offset};
  const double gap = sheet.gap.value;
  const double moved = gap / (z + gap);
  const double right_px = moved * rig.viewing.centre.value / rig.panel.pixel_width.value;
  const double rise_px = moved * rig.viewing.height.value / rig.panel.pixel_height.value;
  return {.pitch = sheet.pitch * (1.0 + gap / z),
          .offset = Lenses(sheet.offset.value +
                           3.0 * (right_px - sheet.slant * rise_px) / sheet.pitch.value)};
}

/// Returns the phase without its whole lenses, in [-1/2, 1/2].
[[nodiscard]] inline double without_whole_lenses(double phase) { return phase - std::round(phase); }

}  // namespace lenticule::optics
