// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/stability/oracle_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "apps/lenticule-bench/stability/phase_oracle.h"
#include "apps/lenticule-bench/stability/ray_oracle.h"
#include "apps/lenticule-bench/stability/small_scenes.h"
#include "apps/lenticule-bench/stability/tally.h"

namespace lenticule::bench {
namespace {

constexpr int kDepth = 5;              // the default of renders
constexpr double kHair = 2e-5;         // mm
constexpr Real kMostStartOff = 5e-5L;  // mm: 2^-20 of (largest coordinate + radius), 50 mm
/// Fraction of the viewing distance: rays start no nearer to the eye.
constexpr Real kNearest = 0.99L;

struct Move {
  Real x = 0;
  Real y = 0;
};

/// Returns the line of a subpixel from in front of the panel into it; heights are paraxial by
/// definition.
OracleLine line_of(const optics::Rig& rig, int i, int j, int channel, Move move) {
  const OracleEye eye = oracle_design_eye(rig);
  const OraclePlace at = oracle_place(oracle_phase(rig, i, j, channel, eye));
  const OracleRay ray = oracle_ray(rig, i, j, channel, at.lens);
  const Real q = Real(rig.panel.pixel_height.value) *
                 (Real(rig.panel.height_px) / 2 -
                  (Real(j) + Real(rig.panel.layout.offset(i, j, channel).y_px)));
  const Real y = (q * eye.z + Real(rig.sheet.gap.value) * eye.y) / (eye.z + rig.sheet.gap.value);
  const Real tan_y = (eye.y - y) / eye.z;
  const Real start = kNearest * eye.z;
  return {{ray.lens_x_mm + move.x + start * ray.tan_x, y + move.y + start * tan_y, start},
          {-ray.tan_x, -tan_y, -1}};
}

Real code_of(const render::SceneDescription& scene, const OracleLine& line, int channel,
             Real start_off) {
  return 255 * std::clamp(oracle_light(scene, line, channel, kDepth, start_off), Real(0), Real(1));
}

}  // namespace

OracleVerdict ask_oracle(const render::SceneDescription& scene, const optics::Rig& rig,
                         SubpixelCode shown, double hair_mm) {
  const Real hair = hair_mm;
  const auto same = [&](Move move, Real start_off = 0) {
    const OracleLine line = line_of(rig, shown.i, shown.j, shown.channel, move);
    return std::fabs(code_of(scene, line, shown.channel, start_off) - Real(shown.code)) <= 1;
  };
  if (same({})) return OracleVerdict::Same;
  for (const Move move : std::array<Move, 4>{{{hair, 0}, {-hair, 0}, {0, hair}, {0, -hair}}})
    if (same(move)) return OracleVerdict::BesideOnly;
  // Later rays may graze outlines too, and the renderer's rays start slightly off their surfaces.
  for (const Real start_off : {kMostStartOff / 4, kMostStartOff / 2, kMostStartOff})
    if (same({}, start_off)) return OracleVerdict::BesideOnly;
  return OracleVerdict::Different;
}

StabilityRow compare_with_oracle(const render::SceneDescription& scene, const optics::Rig& rig,
                                 const StabilitySize& size) {
  const frames::WovenFrame frame = render_small(scene, plain_stage(), rig, size.threads);
  SharedTally shared;
  std::atomic<uint64_t> beside{0};
  for_each_part(size, static_cast<uint64_t>(rig.panel.height_px), [&](uint64_t row) {
    Tally tally;
    const int j = static_cast<int>(row);
    for (int s = 0; s < 3 * rig.panel.width_px; ++s) {
      const OracleVerdict verdict =
          ask_oracle(scene, rig, {s / 3, j, s % 3, frame.row(j)[s]}, kHair);
      tally.check(verdict != OracleVerdict::Different);
      if (verdict == OracleVerdict::BesideOnly) ++beside;
    }
    shared.add(tally);
  });
  return {.samples = shared.sum().samples,
          .samples_are = "subpixels",
          .failures = shared.sum().failures,
          .failures_are = "off by more than one code",
          .note = fmt::format("{} lie on an outline", beside.load())};
}

}  // namespace lenticule::bench
