// SPDX-License-Identifier: Apache-2.0
#include "calib/report/sensitivity.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace lenticule::calib {
namespace {

constexpr int kGreen = 1;

/// Situation is a rig seen by an eye.
struct Situation {
  optics::Rig rig;
  optics::Eye eye;
};

double worst_difference(const Situation& a, const Situation& b) {
  constexpr int kSteps = 16;
  const optics::OpticalModel model_a(a.rig), model_b(b.rig);
  const optics::Panel& panel = a.rig.panel;
  double worst = 0.0;
  for (int r = 0; r <= kSteps; ++r) {
    for (int c = 0; c <= kSteps; ++c) {
      const double x = static_cast<double>(panel.width_px) * c / kSteps;
      const double y = static_cast<double>(panel.height_px) * r / kSteps;
      const double difference =
          model_a.phase(x, y, kGreen, a.eye) - model_b.phase(x, y, kGreen, b.eye);
      worst = std::max(worst, std::abs(difference));
    }
  }
  return worst;
}

struct Change {
  const char* unit;  ///< unit of `amount`
  double amount;
  const char* words;
  void (*apply)(Situation&, double);
};

// The amounts are chosen such that the phase moves by hundredths of a lens on common panels.
constexpr Change kChanges[] = {
    {"K", 1.0, "{} {} warmer or colder, sheet free to expand",
     [](Situation& s, double by) { s.rig.sheet.pitch.value *= 1.0 + kPitchPerKelvin * by; }},
    {"mm", 10.0, "viewer {} {} nearer or farther",
     [](Situation& s, double by) { s.eye.z_mm += by; }},
    {"mm", 5.0, "viewer {} {} to the side", [](Situation& s, double by) { s.eye.x += by; }},
    {"mm", 10.0, "viewer {} {} higher or lower", [](Situation& s, double by) { s.eye.y += by; }},
    {"", 1e-5, "pitch off by {} of itself",
     [](Situation& s, double by) { s.rig.sheet.pitch.value *= 1.0 + by; }},
    {"px/px", 1e-5, "slant off by {} {}", [](Situation& s, double by) { s.rig.sheet.slant += by; }},
    {"lenses", 0.01, "offset off by {} {}",
     [](Situation& s, double by) { s.rig.sheet.offset.value += by; }},
    {"%", 1.0, "gap off by {} {}",
     [](Situation& s, double by) { s.rig.sheet.gap.value *= 1.0 + by / 100.0; }},
};

Sensitivity sensitivity_of(const Change& change, const Situation& now) {
  Situation then = now;
  change.apply(then, change.amount);
  const double worst = worst_difference(now, then);
  const double allowed = change.amount * kVisiblePhaseLenses / std::max(worst, 1e-12);
  return {.change = fmt::format(fmt::runtime(change.words), change.amount, change.unit),
          .worst_lenses = worst,
          .allowed = fmt::format("{:.2g} {}", allowed, change.unit)};
}

}  // namespace

std::vector<Sensitivity> sensitivities(const optics::Rig& rig, const optics::Eye& eye) {
  std::vector<Sensitivity> out;
  for (const Change& change : kChanges) out.push_back(sensitivity_of(change, {rig, eye}));
  return out;
}

}  // namespace lenticule::calib
