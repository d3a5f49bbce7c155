// SPDX-License-Identifier: Apache-2.0
// ViewingZone is where the eyes of the viewers are, and ZoneVisibility tells which subpixels they
// see. docs/render/viewing-zone.md derives the rule.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/interval.h"
#include "optics/model.h"
#include "optics/row_rays.h"

namespace lenticule::optics {

/// ViewingZone is a rectangle of eye positions at the height of the viewing line.
struct ViewingZone {
  Interval x_mm;                   ///< from the centre of the viewing line; negative to the left
  std::optional<Interval> z_mm{};  ///< distances from the panel; none: kZoneDepth around the rig's
};

/// Part of the viewing distance by which eyes may be nearer or farther, unless stated.
inline constexpr double kZoneDepth = 0.05;

/// Parses "60" (60 mm to both sides), "-20:80" (LEFT:RIGHT) or either with "@650:750" (distances).
/// Throws Error(Usage).
[[nodiscard]] ViewingZone parse_viewing_zone(std::string_view text);
/// Returns a text that parse_viewing_zone() takes; equal zones have equal texts.
[[nodiscard]] std::string to_text(const ViewingZone& zone);

/// ZoneVisibility tells which subpixels some eye of a zone sees through any lens: those to which
/// simulate_eye() gives a weight. It is conservative: a subpixel that an eye of the zone sees is
/// never reported as unseen.
///
/// Thread safety: any thread may call evaluate().
class ZoneVisibility {
 public:
  /// Throws Error(Input) for a zone without distances if the rig's viewing distance is infinite.
  ZoneVisibility(const OpticalModel& model, const ViewingZone& zone);

  /// Row holds the result for a row, and the memory of one thread.
  struct Row {
    std::vector<uint8_t> seen;  ///< 1 or 0 for subpixel 3 i + channel
    std::vector<double> phase;  ///< phases of the subpixels of one pixel, lenses
    /// Intervals of phases over the zone, lenses: three for every step_px_-th pixel.
    std::vector<Interval> phases;
  };
  /// Sets `out.seen` for the subpixels of row j.
  void evaluate(int j, Row& out) const;

  /// Returns the largest distance in phase from a lens at which an eye sees a subpixel, in lenses.
  [[nodiscard]] double reach() const { return reach_; }

 private:
  void evaluate_some(int j, Row& out) const;

  int width_px_;
  double reach_;
  int edge_px_;  ///< pixels at either end of a row that count as seen
  int step_px_;  ///< distance of the pixels between which phases are interpolated
  std::vector<RowPhaseEvaluator> corners_;
};

}  // namespace lenticule::optics
