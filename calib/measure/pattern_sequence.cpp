// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/pattern_sequence.h"

#include "calib/measure/rig_code.h"
#include "optics/effective_sheet.h"

namespace lenticule::calib {

std::array<WaveLevel, 3> levels_of(const optics::Rig& rig, bool vertical) {
  return wave_levels(vertical ? rig.panel.height_px : rig.panel.width_px,
                     rig.sheet.pitch.value / 3.0);
}

std::vector<Pattern> locating_patterns() {
  std::vector<Pattern> patterns;
  for (int mark = 0; mark < 3; ++mark)
    patterns.push_back({.shape = Flat{}, .channels = {}, .mark = mark});
  patterns.push_back({.shape = Flat{{1.0, 1.0, 1.0}}, .channels = {}, .mark = 3});
  return patterns;
}

int pattern_count(const MeasureOptions& options) {
  const int geometry = 2 * (4 + 4 + 8);
  const int aliases = options.adaptive ? 2 * kAliasSteps : 0;
  const int link_and_spot = options.link_and_spot ? 4 + kSpotBins : 0;
  return 4 + geometry + kCoarseSteps + aliases + 3 + link_and_spot + 3 * kFineSteps + kRepeatSteps;
}

std::vector<Pattern> photo_patterns(const optics::Rig& start) {
  std::vector<Pattern> patterns = locating_patterns();
  const auto step = [&](auto shape, int steps, Channels channels) {
    for (const double phase : phase_steps(steps)) {
      shape.phase = phase;
      patterns.push_back({.shape = shape, .channels = channels});
    }
  };
  for (const bool vertical : {false, true})
    for (const WaveLevel& level : levels_of(start, vertical))
      step(Wave{.vertical = vertical, .period_px = level.period_px, .phase = 0.0}, level.steps, {});
  const Fringe fringe{.pitch_subpx = optics::effective_sheet(start).pitch.value,
                      .slant = start.sheet.slant,
                      .phase = 0.0};
  step(fringe, kCoarseSteps, {});
  for (int c = 0; c < 3; ++c)
    patterns.push_back({.shape = Flat{{1.0, 1.0, 1.0}}, .channels = Channels::only(c)});
  for (const int c : kChannelOrder) step(fringe, kFineSteps, Channels::only(c));
  step(fringe, kRepeatSteps, Channels::only(1));
  const RigCode code(optics::fingerprint(start));
  for (size_t n = 0; n < patterns.size(); ++n) {
    patterns[n].mark = static_cast<int>(n) % kMarkCounts;
    patterns[n].code = code.of_pattern(n);
  }
  return patterns;
}

}  // namespace lenticule::calib
