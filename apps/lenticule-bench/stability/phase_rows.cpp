// SPDX-License-Identifier: Apache-2.0
// Tests phases over a panel 15360 pixels wide, in every precision in use, against the oracle.
#include <fmt/format.h>

#include <cmath>

#include "apps/lenticule-bench/harness/bench_rigs.h"
#include "apps/lenticule-bench/probes/probe.h"
#include "apps/lenticule-bench/stability/phase_oracle.h"
#include "apps/lenticule-bench/stability/rows.h"
#include "apps/lenticule-bench/stability/small_scenes.h"
#include "apps/lenticule-bench/stability/tally.h"
#include "frames/weave.h"
#include "optics/row_rays.h"

namespace lenticule::bench {
namespace {

constexpr double kViews = 45.0;

/// Returns the kiosk's sheet on a panel larger than any planned one.
optics::Rig large_rig() {
  optics::Rig rig = kiosk_rig();
  rig.panel.width_px = 15360;
  rig.panel.height_px = 8640;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.08);
  rig.sheet.gap = Millimetres(1.15);
  rig.viewing.height = Millimetres(37.0);
  return rig;
}

struct Expected {
  OraclePlace at;
  int view = 0;
};
Expected expected(const optics::Rig& rig, int i, int j, int channel) {
  const OraclePlace at = oracle_place(oracle_phase(rig, i, j, channel, oracle_design_eye(rig)));
  // Views of docs/panel/optics.md: a border belongs to the view on its left, with the tolerance of
  // lenses.
  const Real number = Real(kViews) * (Real(0.5) - at.place) - Real(kViews) / Real(4294967296.0);
  return {at, static_cast<int>(std::ceil(number)) - 1};
}

void compare(const Expected& oracle, int64_t lens, double place, Tally& tally) {
  const int view =
      frames::nearest_view(optics::view_number(place, kViews), static_cast<int>(kViews));
  tally.check(lens == oracle.at.lens && view == oracle.view);
  if (lens == oracle.at.lens)
    tally.error(static_cast<double>(std::fabs(Real(place) - oracle.at.place)));
}

/// Returns the number of rows to test: a few dozen including the first and the last, or all.
uint64_t row_count(const optics::Rig& rig, const StabilitySize& size) {
  return size.samples(24, static_cast<uint64_t>(rig.panel.height_px));
}
int row_number(const optics::Rig& rig, uint64_t count, uint64_t k) {
  return static_cast<int>(k * static_cast<uint64_t>(rig.panel.height_px - 1) / (count - 1));
}

StabilityRow filled(const char* stressed, const Tally& tally) {
  return {.stressed = stressed,
          .samples = tally.samples,
          .samples_are = "subpixels",
          .failures = tally.failures,
          .failures_are = "wrong lenses or views",
          .worst = tally.worst,
          .bound = 1e-9,
          .unit = "lens"};
}

}  // namespace

StabilityRow stability_phase_scalar(const StabilitySize& size) {
  const optics::Rig rig = large_rig();
  const optics::OpticalModel model(rig);
  const uint64_t rows = row_count(rig, size);
  SharedTally shared;
  for_each_part(size, rows, [&](uint64_t k) {
    Tally tally;
    const int j = row_number(rig, rows, k);
    for (int s = 0; s < 3 * rig.panel.width_px; ++s) {
      const optics::SubpixelRay ray = model.ray(s / 3, j, s % 3);
      compare(expected(rig, s / 3, j, s % 3), ray.lens, ray.place, tally);
    }
    shared.add(tally);
  });
  return filled("scalar double, 15360x8640, 45 views, seen from 700 mm", shared.sum());
}

StabilityRow stability_phase_kernels(const StabilitySize& size) {
  const optics::Rig rig = large_rig();
  const optics::OpticalModel model(rig);
  std::vector<optics::RowRayEvaluator> kernels;
  std::string names;
  for (const Isa isa : {Isa::Baseline, Isa::Neon, Isa::Avx2, Isa::Avx512}) {
    if (!isa_supported(isa)) continue;
    kernels.emplace_back(model, isa);
    names += (names.empty() ? "" : ", ") + std::string(isa_name(isa));
  }
  const uint64_t rows = row_count(rig, size);
  SharedTally shared;
  for_each_part(size, rows, [&](uint64_t k) {
    Tally tally;
    const int j = row_number(rig, rows, k);
    static thread_local std::vector<optics::RowRays> rays;
    rays.resize(kernels.size());
    for (size_t n = 0; n < kernels.size(); ++n)
      kernels[n].evaluate(j, 0, rig.panel.width_px, rays[n]);
    for (int s = 0; s < 3 * rig.panel.width_px; ++s) {
      const Expected oracle = expected(rig, s / 3, j, s % 3);
      const auto at = static_cast<size_t>(s);
      for (const optics::RowRays& row : rays) compare(oracle, row.lens[at], row.place[at], tally);
    }
    shared.add(tally);
  });
  StabilityRow row = filled("vector kernels, the same panel", shared.sum());
  row.note = "instruction sets: " + names;
  return row;
}

StabilityRow stability_phase_tiles(const StabilitySize& size) {
  optics::Rig rig = large_rig();
  // The cones of views would not fit at less than a panel's width.
  rig.viewing.distance = Millimetres(1500.0);
  const optics::OpticalModel model(rig);
  const PlainStage plain(rig);
  const PrimaryProbe probe(plain.scene, model, best_isa());
  const auto tiles = static_cast<uint64_t>(probe.tiles());
  const uint64_t step = size.samples(599, 1);  // prime, so that all columns and bands are covered
  SharedTally shared;
  for_each_part(size, (tiles + step - 1) / step, [&](uint64_t k) {
    Tally tally;
    static thread_local std::vector<PrimaryProbe::Line> lines;
    probe.lines(static_cast<int>(k * step), lines);
    uint64_t n = 0;
    for (const auto& line : lines) {
      const int i = line.subpixel / 3;
      const int channel = line.subpixel % 3;
      const OraclePlace at =
          oracle_place(oracle_phase(rig, i, line.row, channel, oracle_design_eye(rig)));
      // The ray leaves through the apex line of its lens. (Heights are paraxial: a fraction of a
      // pixel.)
      const Real through = oracle_lens_at(rig, line.x_mm, line.y_mm, channel);
      tally.check(std::fabs(through - static_cast<Real>(at.lens)) < Real(0.25));
      if (n++ % 64 != 0) continue;  // the oracle's eye is slow to find
      const OracleRay oracle = oracle_ray(rig, i, line.row, channel, at.lens);
      tally.error(static_cast<double>(std::fabs(Real(line.tan_x) - oracle.tan_x)));
    }
    shared.add(tally);
  });
  StabilityRow row = filled(
      "polynomials of tiles, as the renderer uses them, the same panel from 1500 mm", shared.sum());
  row.failures_are = "wrong lenses";
  if (!probe.fast()) row.samples = 0;  // these rays came from the optical map itself
  row.bound = 4e-7;
  row.unit = "of a direction";
  return row;
}

}  // namespace lenticule::bench
