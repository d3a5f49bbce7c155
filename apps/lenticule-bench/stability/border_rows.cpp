// SPDX-License-Identifier: Apache-2.0
// Tests rational pitches and slants: whole columns of subpixels lie exactly on the borders of
// lenses and views, and integer arithmetic gives the correct lens and view.
#include <fmt/format.h>

#include <atomic>
#include <cmath>

#include "apps/lenticule-bench/probes/probe.h"
#include "apps/lenticule-bench/stability/phase_oracle.h"
#include "apps/lenticule-bench/stability/rows.h"
#include "apps/lenticule-bench/stability/small_scenes.h"
#include "apps/lenticule-bench/stability/tally.h"
#include "frames/weave.h"
#include "optics/row_rays.h"

namespace lenticule::bench {
namespace {

constexpr int kWidth = 15360, kHeight = 8640;

/// Pitch = pitch / pitch_by subpixels, slant = slant / slant_by, and the number of views.
struct RationalSheet {
  int pitch, pitch_by;
  int slant, slant_by;
  int views;
};

std::vector<RationalSheet> sheets() {
  std::vector<RationalSheet> all;
  struct Fraction {
    int number, by;
  };
  for (const Fraction p : {Fraction{2, 1}, {3, 1}, {6, 1}, {7, 1}, {15, 2}, {23, 3}, {3000, 1}})
    for (const Fraction m : {Fraction{0, 1}, {1, 3}, {1, 1}, {-1, 1}})
      all.push_back({p.number, p.by, m.number, m.by, p.number > 100 ? 100 : p.number});
  return all;
}

optics::Rig rational_rig(const RationalSheet& sheet) {
  optics::Rig rig;
  rig.panel.width_px = kWidth;
  rig.panel.height_px = kHeight;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.08);
  rig.sheet.pitch = Subpixels(static_cast<double>(sheet.pitch) / sheet.pitch_by);
  rig.sheet.slant = static_cast<double>(sheet.slant) / sheet.slant_by;
  rig.sheet.gap = Millimetres(rig.sheet.pitch.value * 0.08 / 3.0 / 0.5);
  return rig;
}

int64_t floor_divide(int64_t a, int64_t b) {
  return a / b - (a % b < 0 ? 1 : 0);
}

struct Owner {
  int64_t lens = 0;
  int view = 0;
  bool on_border = false;
};

/// Owners computes the lens and view of each subpixel of a sheet with integers only.
///
/// phase = 3 [(i + 1/6 + c/3 - W/2) + m (j + 1/2 - H/2)] / P is number / by, two integers; from
/// subpixel to subpixel of a row the number grows by a constant. View and border depend on its
/// remainder and are looked up in a table.
class Owners {
 public:
  explicit Owners(const RationalSheet& sheet)
      : sheet_(sheet), by_(int64_t{2} * sheet.slant_by * sheet.pitch) {
    for (int64_t rest = 0; rest < by_; ++rest) of_rest_.push_back(owner(rest));
  }

  /// Calls see(subpixel, owner) for every subpixel of row j, from left to right.
  template <class See>
  void row(int j, const See& see) const {
    const int64_t first = number(0, j);
    const int64_t step = number(1, j) - first;
    int64_t turn = floor_divide(first, by_);
    int64_t rest = first - turn * by_;
    for (int s = 0; s < 3 * kWidth; ++s) {
      Owner here = of_rest_[static_cast<size_t>(rest)];
      here.lens += turn;
      see(s, here);
      for (rest += step; rest >= by_; rest -= by_) ++turn;
    }
  }

  [[nodiscard]] int64_t lens(int s, int j) const { return owner(number(s, j)).lens; }

 private:
  [[nodiscard]] int64_t number(int s, int j) const {
    // 6 i + 2 c is twice the subpixel's number in its row.
    const int64_t sixths = int64_t{sheet_.slant_by} * (2 * int64_t{s} + 1 - 3 * kWidth) +
                           int64_t{sheet_.slant} * 3 * (2 * int64_t{j} + 1 - kHeight);
    return sixths * sheet_.pitch_by;
  }
  [[nodiscard]] Owner owner(int64_t number) const {
    const int64_t lens = floor_divide(2 * number + by_, 2 * by_);
    // view = ceil(views (1/2 - place)) - 1, place = number / by - lens in [-1/2, 1/2).
    const int64_t place = number - lens * by_;
    const int64_t view_number = sheet_.views * (by_ - 2 * place);
    const int64_t view = -floor_divide(-view_number, 2 * by_) - 1;
    return {lens, static_cast<int>(view),
            2 * place == -by_ || floor_divide(view_number, 2 * by_) * 2 * by_ == view_number};
  }

  RationalSheet sheet_;
  int64_t by_;
  std::vector<Owner> of_rest_;
};

constexpr const char* kStressed =
    "pitches 2, 3, 6, 7, 15/2, 23/3, 3000 with slants 0, 1/3, 1, -1 on 15360x8640";

}  // namespace

StabilityRow stability_borders(const StabilitySize& size) {
  SharedTally shared;
  std::atomic<uint64_t> on_border{0};
  const int step = static_cast<int>(size.samples(619, 1));
  for (const RationalSheet& sheet : sheets()) {
    const optics::OpticalModel model(rational_rig(sheet));
    const Owners owners(sheet);
    std::vector<optics::RowRayEvaluator> kernels;
    for (const Isa isa : {Isa::Baseline, Isa::Neon, Isa::Avx2, Isa::Avx512})
      if (isa_supported(isa)) kernels.emplace_back(model, isa);
    for_each_part(size, static_cast<uint64_t>((kHeight + step - 1) / step), [&](uint64_t k) {
      Tally tally;
      uint64_t borders = 0;
      const int j = static_cast<int>(k) * step;
      // Reused for all rows, because allocating a megabyte for each costs more than filling it.
      static thread_local std::vector<optics::RowRays> rays;
      rays.resize(kernels.size());
      for (size_t n = 0; n < kernels.size(); ++n) kernels[n].evaluate(j, 0, kWidth, rays[n]);
      owners.row(j, [&](int s, const Owner& ground_truth) {
        borders += ground_truth.on_border ? 1 : 0;
        const auto check = [&](int64_t lens, double place) {
          const double number = optics::view_number(place, sheet.views);
          tally.check(lens == ground_truth.lens && place >= -0.5 && place < 0.5 &&
                      frames::nearest_view(number, sheet.views) == ground_truth.view);
        };
        const auto at = static_cast<size_t>(s);
        for (const optics::RowRays& row : rays) check(row.lens[at], row.place[at]);
        if (s % 16 != 0) return;
        const optics::SubpixelRay ray = model.ray(s / 3, j, s % 3);
        check(ray.lens, ray.place);
      });
      on_border += borders;
      shared.add(tally);
    });
  }
  return {
      .stressed = kStressed,
      .samples = shared.sum().samples,
      .samples_are = "phases",
      .failures = shared.sum().failures,
      .failures_are = "wrong lenses or views",
      .note = fmt::format("{} subpixels exactly on a border of a lens or view", on_border.load())};
}

StabilityRow stability_borders_tiles(const StabilitySize& size) {
  SharedTally shared;
  const uint64_t step = size.samples(4099, 1);
  int by_polynomials = 0;
  for (const RationalSheet& sheet : sheets()) {
    const optics::Rig rig = rational_rig(sheet);
    const optics::OpticalModel model(rig);
    const PlainStage plain(rig);
    const Owners owners(sheet);
    const PrimaryProbe probe(plain.scene, model, best_isa());
    by_polynomials += probe.fast() ? 1 : 0;
    const auto tiles = static_cast<uint64_t>(probe.tiles());
    for_each_part(size, (tiles + step - 1) / step, [&](uint64_t k) {
      Tally tally;
      static thread_local std::vector<PrimaryProbe::Line> lines;
      probe.lines(static_cast<int>(k * step), lines);
      for (const auto& line : lines) {
        const int64_t lens = owners.lens(line.subpixel, line.row);
        const Real through = oracle_lens_at(rig, line.x_mm, line.y_mm, line.subpixel % 3);
        tally.check(std::fabs(through - static_cast<Real>(lens)) < Real(0.25));
      }
      shared.add(tally);
    });
  }
  return {.stressed = "the same through the polynomials of tiles",
          .samples = shared.sum().samples,
          .samples_are = "rays",
          .failures = shared.sum().failures,
          .failures_are = "through the wrong lens",
          .note = fmt::format("{} of {} sheets by polynomials", by_polynomials, sheets().size())};
}

}  // namespace lenticule::bench
