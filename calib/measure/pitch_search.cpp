// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/pitch_search.h"

#include <array>
#include <cmath>
#include <utility>

#include "calib/measure/pattern_sequence.h"
#include "optics/rig.h"

namespace lenticule::calib {
namespace {

constexpr int kMostMultiple = 3;  ///< largest multiple of the starting pitch that is tried
/// Largest error of the starting pitch, relative to the number of lenses across the panel.
constexpr double kCaptureRange = 0.13;
constexpr double kLeastCoherent =
    0.12;                           ///< fraction of the fringes' light that one phase must explain
constexpr double kLeastLead = 2.0;  ///< ratio to the next best phase
constexpr double kAliasPart =
    0.4;  ///< fraction of the first pattern's coherence, at a multiple of its pitch

/// Pitches to try when the starting one shows no fringes, as multiples of it.
constexpr std::array<double, 5> kOtherPitches = {1.0, 0.5, 2.0, 1.0 / 3.0, 3.0};

LinearPhase phase_for(double pitch, double slant) {
  return {.constant = 0.0, .per_px_x = 3.0 / pitch, .per_px_y = 3.0 * slant / pitch};
}

std::optional<FringePeak> peak_of(const FringeTrials& trials, const Fringes& fringes,
                                  const LinearPhase& start) {
  const double lenses = std::abs(start.per_px_x) * trials.panel.width_px;
  const FringeView view{fringes.fringe, fringes.waves, trials.panel_points};
  std::optional<FringePeak> peak =
      find_fringes(view, start, kCaptureRange * lenses + 6.0, trials.panel);
  const bool good = peak && fringes.contrast > kLeastModulation && peak->height > kLeastCoherent &&
                    peak->height > kLeastLead * peak->second;
  return good ? peak : std::nullopt;
}

/// Returns true if fringes appear at a multiple of the pitch. Only at the true pitch do the slow
/// fringes disappear when the pattern gets wider by an integer factor: neighbouring lenses then see
/// different phases.
bool multiple_shows_fringes(const FringeTrials& trials, const LinearPhase& line, int factor,
                            double first_coherence) {
  const double pitch = line.pitch_subpx() * factor;
  if (pitch > trials.panel.width_px / 4.0) return false;
  const double slant = line.slant();
  const Fringes fringes = trials.show(pitch, slant, kAliasSteps);
  const FringeView view{fringes.fringe, fringes.waves, trials.panel_points};
  const std::optional<FringePeak> peak =
      find_fringes(view, phase_for(pitch, slant), 6.0, trials.panel);
  return peak && peak->height * fringes.contrast > kAliasPart * first_coherence;
}

}  // namespace

std::optional<FoundFringes> search_pitch(const FringeTrials& trials, double nominal_pitch_subpx,
                                         double slant, bool tries_others) {
  for (const double factor : kOtherPitches) {
    const double pitch = nominal_pitch_subpx * factor;
    if (pitch < optics::kMinPitchSubpixels || pitch > trials.panel.width_px / 4.0) continue;
    Fringes fringes = trials.show(pitch, slant, kCoarseSteps);
    if (const auto peak = peak_of(trials, fringes, phase_for(pitch, slant)))
      return FoundFringes{std::move(fringes), *peak};
    if (!tries_others) break;
  }
  return std::nullopt;
}

AliasFreeLine leave_aliases(const FringeTrials& trials, const LinearPhase& line,
                            const FoundFringes& first) {
  const double first_coherence = first.peak.height * first.fringes.contrast;
  AliasFreeLine out{.line = line, .multiples = {}};
  int multiple = 2;
  while (multiple <= kMostMultiple) {
    if (!multiple_shows_fringes(trials, out.line, multiple, first_coherence)) {
      ++multiple;
      continue;
    }
    out.multiples.push_back(multiple);
    out.line = {.constant = out.line.constant / multiple,
                .per_px_x = out.line.per_px_x / multiple,
                .per_px_y = out.line.per_px_y / multiple};
    multiple = 2;
  }
  return out;
}

}  // namespace lenticule::calib
