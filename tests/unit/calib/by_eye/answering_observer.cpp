// SPDX-License-Identifier: Apache-2.0
#include "tests/unit/calib/by_eye/answering_observer.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "optics/rig.h"
#include "tests/support/oracles/optics_oracle.h"

namespace lenticule::calib::test {
namespace {

using frames::kBands;
using lenticule::test::oracle_phase;
using lenticule::test::Real;

constexpr int kNone = -1;
constexpr int kGreen = 1;

/// Returns the phase that the eye on the rig's viewing line sees at (x, y), in panels from the
/// panel's centre.
Real phase_at(const optics::Rig& rig, double x, double y, int channel) {
  const lenticule::test::RealEye eye = {rig.viewing.centre.value, rig.viewing.height.value,
                                        rig.viewing.distance.value};
  return oracle_phase(rig, {(0.5 + x) * rig.panel.width_px, (0.5 + y) * rig.panel.height_px},
                      channel, eye);
}

/// Returns (red - green) / (red + green) of a chart of two views that is `lenses` off: red for 0
/// ... 1/2, green for -1/2 ... 0. Subpixels of one colour are three apart, so the borders are this
/// wide.
double redness_of(double lenses, double pitch_subpx) {
  const double place = optics::without_whole_lenses(lenses);
  const double nearest = std::abs(place) < 0.25 ? place : (place > 0.0 ? 0.5 : -0.5) - place;
  return std::clamp(nearest * pitch_subpx / 1.5, -1.0, 1.0);
}

}  // namespace

AnsweringObserver::AnsweringObserver(const optics::Rig& ground_truth, Procedure& procedure,
                                     const Eyesight& eyesight, uint64_t seed)
    : ground_truth_(rig_seen_from(ground_truth, procedure.distance_mm())),
      procedure_(procedure),
      eyesight_(eyesight),
      random_(seed) {}

int AnsweringObserver::answer(int most) {
  int answers = 0;
  while (procedure_.is_asking() && procedure_.status() == Procedure::Status::Running &&
         !procedure_.questions().is_done() && answers < most) {
    const int right = right_answer();
    const bool is_wrong = draw(1000) < static_cast<int>(1000.0 * eyesight_.wrong_share);
    mark_and_enter(is_wrong ? wrong_answer(right) : right);
    wrong_ += is_wrong ? 1 : 0;
    ++answers;
  }
  return answers;
}

int AnsweringObserver::draw(int below) {
  return static_cast<int>(random_() % static_cast<uint64_t>(below));
}

int AnsweringObserver::wrong_answer(int right) {
  if (!eyesight_.nearly_right) return (right + 2 + draw(kBands)) % (kBands + 1) - 1;
  const int off = 2 + draw(3);
  return std::clamp(right + (draw(2) == 0 ? off : -off), -1, kBands);
}

int AnsweringObserver::right_answer() {
  const Chart chart = procedure_.chart();
  return chart.pattern == ChartPattern::Ladder ? turning_rung(chart) : best_band(chart);
}

void AnsweringObserver::mark_and_enter(int band) {
  const auto press = [&](Key key, Stride stride) {
    procedure_.press({key, stride});
    ++presses_;
  };
  const auto moves = std::div(std::abs(band - procedure_.chart().cursor), 5);
  const Key key = band < procedure_.chart().cursor ? Key::Up : Key::Down;
  for (int n = 0; n < moves.quot; ++n) press(key, Stride::Coarse);
  for (int n = 0; n < moves.rem; ++n) press(key, Stride::Normal);
  press(Key::Next, Stride::Normal);
}

// --- bands ------------------------------------------------------------------------------------

/// Returns the number of stripes along a band, from edge to edge of the panel.
double AnsweringObserver::stripes(const Chart& chart, int band) const {
  const double middle = (band + 0.5) / kBands - 0.5;
  const bool across = chart.pattern == ChartPattern::Bands;
  const auto span = [&](const optics::Rig& rig) {
    return static_cast<double>(
        across ? phase_at(rig, 0.5, middle, kGreen) - phase_at(rig, -0.5, middle, kGreen)
               : phase_at(rig, middle, 0.5, kGreen) - phase_at(rig, middle, -0.5, kGreen));
  };
  const double drawn = span(chart.rig);
  if (across)
    return std::abs(span(ground_truth_) - drawn / frames::band_scale(band, chart.band_reach));
  const double slanted = 3.0 * chart.rig.panel.height_px /
                         optics::effective_sheet(chart.rig).pitch.value *
                         frames::band_shift(chart.pattern, band, chart.band_reach);
  return std::abs(span(ground_truth_) - drawn - slanted);
}

/// Returns the middle of the bands that look best; none if they get better up to the last band.
int AnsweringObserver::best_band(const Chart& chart) {
  std::vector<double> counts;
  for (int band = 0; band < kBands; ++band) counts.push_back(stripes(chart, band));
  const auto fewest = std::min_element(counts.begin(), counts.end());
  const double change = std::abs(counts.at(1) - counts.at(0));
  const bool at_end = fewest == counts.begin() || fewest == counts.end() - 1;
  if (at_end && *fewest > 0.75 * change + eyesight_.stripe_threshold) return kNone;
  std::vector<int> alike;
  for (int band = 0; band < kBands; ++band)
    if (counts.at(static_cast<size_t>(band)) <= *fewest + eyesight_.stripe_threshold)
      alike.push_back(band);
  return alike.at(static_cast<size_t>(draw(static_cast<int>(alike.size()))));
}

// --- ladders ----------------------------------------------------------------------------------

/// Returns the mean colour of a rung.
double AnsweringObserver::redness(const Chart& chart, int rung) const {
  constexpr int kSamples = 9;
  const double y = frames::rung_y(chart.ladder_y, rung);
  double sum = 0.0;
  for (int n = 0; n < kSamples; ++n) {
    const double x = chart.ladder_x + frames::kLadderWidth * ((n + 0.5) / kSamples - 0.5);
    const double seen = static_cast<double>(phase_at(chart.rig, x, y, kGreen) -
                                            phase_at(ground_truth_, x, y, kGreen));
    sum += redness_of(seen + frames::band_shift(chart.pattern, rung, chart.band_reach),
                      ground_truth_.sheet.pitch.value);
  }
  return sum / kSamples;
}

/// Returns the rung on which red above turns into green below; any of those that look equal.
int AnsweringObserver::turning_rung(const Chart& chart) {
  constexpr double kDistinct = 0.1;
  std::vector<double> colours;
  for (int rung = 0; rung < kBands; ++rung) colours.push_back(redness(chart, rung));
  std::vector<int> yellow;
  bool was_red = false;
  for (int rung = 0; rung < kBands; ++rung) {
    const double colour = colours.at(static_cast<size_t>(rung));
    if (colour > kDistinct) {
      was_red = true;
      yellow.clear();
    } else if (was_red && std::abs(colour) <= eyesight_.threshold) {
      yellow.push_back(rung);
    } else if (was_red && colour < 0.0) {
      if (!yellow.empty())
        return yellow.at(static_cast<size_t>(draw(static_cast<int>(yellow.size()))));
      // No rung is yellow: the one nearer to it of both beside the turn.
      const double above = colours.at(static_cast<size_t>(rung - 1));
      return std::abs(above) < std::abs(colour) ? rung - 1 : rung;
    }
  }
  return kNone;
}

// --- results ----------------------------------------------------------------------------------

double worst_error_lenses(const optics::Rig& one, const optics::Rig& other) {
  constexpr int kPoints = 9;
  double worst = 0.0;
  for (int v = 0; v < kPoints; ++v)
    for (int u = 0; u < kPoints; ++u) {
      const double x = u / (kPoints - 1.0) - 0.5, y = v / (kPoints - 1.0) - 0.5;
      for (int channel = 0; channel < 3; ++channel)
        worst =
            std::max(worst, std::abs(optics::without_whole_lenses(static_cast<double>(
                                phase_at(one, x, y, channel) - phase_at(other, x, y, channel)))));
    }
  return worst;
}

}  // namespace lenticule::calib::test
