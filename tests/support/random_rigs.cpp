// SPDX-License-Identifier: Apache-2.0
#include "tests/support/random_rigs.h"

#include <array>

namespace lenticule::test {
namespace {

using optics::PixelCell;
using optics::Rig;
using optics::SubpixelLayout;

// std::uniform_*_distribution differs between libraries; these functions do not.
double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * (static_cast<double>(random() >> 11) * 0x1p-53);
}
int pick(std::mt19937_64& random, int count) {
  return static_cast<int>(random() % static_cast<uint64_t>(count));
}

SubpixelLayout random_layout(std::mt19937_64& random) {
  constexpr std::array<const char*, 4> kNames{"rgb", "bgr", "vrgb", "vbgr"};
  const int kind = pick(random, 6);
  if (kind < 4) return SubpixelLayout::named(kNames[static_cast<size_t>(kind)]);
  const int columns = 1 + pick(random, 5), rows = 1 + pick(random, 4);
  std::vector<PixelCell> cells(static_cast<size_t>(columns * rows));
  for (PixelCell& cell : cells) {
    for (optics::SubpixelOffset& offset : cell) {
      offset = {uniform(random, -0.5, 1.5), uniform(random, -0.5, 1.5)};
    }
  }
  return SubpixelLayout::cells(columns, rows, std::move(cells));
}

double random_slant(std::mt19937_64& random) {
  switch (pick(random, 6)) {
    case 0:
      return 0.0;
    case 1:
      return 1.0;
    case 2:
      return -1.0;
    case 3:
      return 1.0 / 3.0;
    default:
      return uniform(random, -1.2, 1.2);
  }
}

Rig random_candidate(std::mt19937_64& random) {
  constexpr std::array<std::array<int, 2>, 5> kSizes{
      {{15360, 8640}, {3840, 2160}, {1536, 2048}, {97, 61}, {1, 1}}};
  Rig rig;
  rig.name = "random";
  const auto& size = kSizes[static_cast<size_t>(pick(random, 5))];
  rig.panel.width_px = size[0];
  rig.panel.height_px = size[1];
  const double pixel = uniform(random, 0.03, 0.4);
  rig.panel.pixel_width = Millimetres(pixel);
  rig.panel.pixel_height =
      Millimetres(pick(random, 3) == 0 ? pixel * uniform(random, 0.8, 1.25) : pixel);
  rig.panel.layout = random_layout(random);
  rig.sheet.pitch = Subpixels(uniform(random, 2.0, 60.0));
  rig.sheet.slant = random_slant(random);
  rig.sheet.offset = Lenses(uniform(random, -2.0, 2.0));
  const double lens_mm = rig.sheet.pitch.value * pixel / 3.0;
  rig.sheet.gap = Millimetres(lens_mm * uniform(random, 1.0, 8.0));
  rig.sheet.refraction_shape = pick(random, 4) == 0 ? 1.0 : uniform(random, 0.35, 1.0);
  if (pick(random, 3) == 0) {
    rig.sheet.channel_offset = {Subpixels(uniform(random, -0.3, 0.3)), Subpixels(0.0),
                                Subpixels(uniform(random, -0.3, 0.3))};
  }
  if (pick(random, 3) == 0) {
    rig.sheet.residual = random_residual(random, 1 + pick(random, 12), 1 + pick(random, 8), 0.15);
  }
  if (pick(random, 4) != 0) {
    rig.viewing.distance = Millimetres(uniform(random, 200.0, 5000.0));
    rig.viewing.height = Millimetres(uniform(random, -300.0, 300.0));
    if (pick(random, 3) == 0) rig.viewing.centre = Millimetres(uniform(random, -300.0, 300.0));
  }
  if (pick(random, 4) == 0) rig.panel.bits = optics::kDeepBits;
  return rig;
}

}  // namespace

Rig kiosk_rig() {
  Rig rig;
  rig.name = "kiosk";
  rig.panel.width_px = 3840;
  rig.panel.height_px = 2160;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.15567);
  rig.sheet.pitch = Subpixels(7.701);
  rig.sheet.slant = 0.2521;
  rig.sheet.gap = Millimetres(2.238);
  rig.sheet.refraction_shape = 1.0 / 2.25;
  rig.viewing.distance = Millimetres(700.0);
  return rig;
}

Rig upright_rig() {
  Rig rig;
  rig.name = "upright";
  rig.panel.width_px = 512;
  rig.panel.height_px = 96;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.25);
  rig.sheet.pitch = Subpixels(24.0);
  rig.sheet.offset = Lenses(0.5);
  rig.sheet.gap = Millimetres(4.0);
  rig.sheet.refraction_shape = 1.0 / 2.25;
  rig.sheet.spot_sigma = Lenses(0.02);
  return rig;
}

Rig random_rig(std::mt19937_64& random) {
  for (;;) {
    Rig rig = random_candidate(random);
    if (!optics::find_problem(rig)) return rig;
  }
}

optics::ResidualMap random_residual(std::mt19937_64& random, int columns, int rows, double lenses) {
  optics::ResidualMap map{.columns = columns, .rows = rows, .lenses = {}};
  for (int n = 0; n < columns * rows; ++n) map.lenses.push_back(uniform(random, -lenses, lenses));
  return map;
}

}  // namespace lenticule::test
