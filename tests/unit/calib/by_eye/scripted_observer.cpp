// SPDX-License-Identifier: Apache-2.0
#include "tests/unit/calib/by_eye/scripted_observer.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "frames/charts/charts.h"
#include "optics/eye_simulator.h"

namespace lenticule::calib::test {
namespace {

double linear(uint8_t code) { return std::pow(code / 255.0, 2.2); }

}  // namespace

double Glimpse::redness(double x0, double x1, double y0, double y1) const {
  double r = 0.0, g = 0.0;
  for (int v = static_cast<int>(y0 * rows); v < static_cast<int>(y1 * rows); ++v)
    for (int u = static_cast<int>(x0 * columns); u < static_cast<int>(x1 * columns); ++u) {
      r += red[static_cast<size_t>(v * columns + u)];
      g += green[static_cast<size_t>(v * columns + u)];
    }
  return r + g > 0.0 ? (r - g) / (r + g) : 0.0;
}

ScriptedObserver::ScriptedObserver(const optics::Rig& ground_truth, Procedure& procedure)
    : ground_truth_(ground_truth),
      procedure_(procedure),
      frame_({.width = ground_truth.panel.width_px, .height = ground_truth.panel.height_px}) {}

/// Draws only the rows that are used.
Glimpse ScriptedObserver::look(double x_mm, int columns, int rows) {
  const optics::Rig& rig = ground_truth_.rig();
  const frames::ChartPainter painter(procedure_.chart());
  const int height = rig.panel.height_px;
  const double distance = procedure_.eye_distance_mm();
  const double furthest =
      0.5 * height * rig.panel.pixel_height.value + std::abs(rig.viewing.height.value);
  const int reach = 2 + static_cast<int>(rig.sheet.gap.value * furthest / distance /
                                         rig.panel.pixel_height.value);
  for (int v = 0; v < rows; ++v) {
    const int j = static_cast<int>((v + 0.5) * height / rows);
    painter.paint_rows(std::max(0, j - reach), std::min(height, j + reach + 1), frame_);
  }
  const optics::RgbPicture seen =
      optics::simulate_eye(ground_truth_,
                           {.pixels = frame_.bytes().data(),
                            .width = frame_.width(),
                            .height = height,
                            .stride_bytes = frame_.geometry().row_bytes()},
                           {.x = x_mm, .y = rig.viewing.height.value, .z_mm = distance},
                           {.width = columns, .height = rows});
  Glimpse glimpse{.columns = columns, .rows = rows, .red = {}, .green = {}, .blue = {}};
  for (size_t n = 0; n < seen.pixels.size(); n += 3) {
    glimpse.red.push_back(linear(seen.pixels[n]));
    glimpse.green.push_back(linear(seen.pixels[n + 1]));
    glimpse.blue.push_back(linear(seen.pixels[n + 2]));
  }
  return glimpse;
}

void ScriptedObserver::press_often(double presses, Key more, Key less) {
  const Key key = presses < 0.0 ? less : more;
  int tenths = static_cast<int>(std::lround(std::min(std::abs(presses), 2000.0) * 10.0));
  for (; tenths >= 100; tenths -= 100) press(key, Stride::Coarse);
  for (; tenths >= 10; tenths -= 10) press(key);
  for (; tenths > 0; --tenths) press(key, Stride::Fine);
}

void ScriptedObserver::null(const std::function<double()>& measure, double presses_per_unit,
                            Key more, Key less, int rounds) {
  double sign = 1.0, before = measure();
  for (int round = 0; round < rounds; ++round) {
    const double presses = before * presses_per_unit;
    if (std::abs(presses) < 0.05) return;
    press_often(sign * presses, more, less);
    double after = measure();
    if (std::abs(after) > std::abs(before)) {
      sign = -sign;
      press_often(2.0 * sign * presses, more, less);
      after = measure();
    }
    before = after;
  }
}

/// Returns the place where the middle turns from red to green.
double ScriptedObserver::crossing(double from_mm, double to_mm) {
  for (int n = 0; n < 14; ++n) {
    const double middle = 0.5 * (from_mm + to_mm);
    const double seen = look(middle, 300, 15).redness(0.4, 0.6, 0.4, 0.6);
    (seen > 0.0 ? from_mm : to_mm) = middle;
  }
  return 0.5 * (from_mm + to_mm);
}

void ScriptedObserver::find_gap_by_flips() {
  const auto red_at = [&](double x_mm) {
    return look(x_mm, 300, 15).redness(0.4, 0.6, 0.4, 0.6) > 0.0;
  };
  // Steps to either side, from the turn in the middle to the next ones of the same kind.
  std::vector<double> turns;
  constexpr double kStep = 8.0, kFar = 200.0;
  bool was_red = red_at(-kFar);
  for (double x = -kFar + kStep; x <= kFar; x += kStep) {
    const bool is_red = red_at(x);
    if (was_red && !is_red) turns.push_back(crossing(x - kStep, x));
    was_red = is_red;
  }
  if (turns.size() < 2) return;
  const double spacing = (turns.back() - turns.front()) / static_cast<double>(turns.size() - 1);
  const std::string numbers = procedure_.numbers();
  const size_t place = numbers.find("red to red ");
  const double shown = std::stod(numbers.substr(place + 11));
  press_often((spacing - shown) / kSpacingStepMm, Key::Right, Key::Left);
}

void ScriptedObserver::find_gap_by_distance() {
  press(Key::OtherPattern);
  const optics::Rig shown = procedure_.chart().rig;
  const double lens_per_unit = 1.5 / shown.sheet.pitch.value;
  const double lenses_across = 3.0 * shown.panel.width_px / shown.sheet.pitch.value;
  const auto sideways = [&] {
    const Glimpse seen = look(0.0, 600, 30);
    return seen.redness(0.82, 0.98, 0.3, 0.7) - seen.redness(0.02, 0.18, 0.3, 0.7);
  };
  null(sideways, lens_per_unit / (0.8 * lenses_across) / kPitchStep, Key::Up, Key::Down, 6);
}

}  // namespace lenticule::calib::test
