// SPDX-License-Identifier: Apache-2.0
// Tests which subpixels a viewing zone sees: against eyes on a fine grid, and by the pictures that
// simulated eyes see without the others.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "base/error.h"
#include "optics/eye_simulator.h"
#include "optics/zone/viewing_zone.h"
#include "tests/support/oracles/zone_oracle.h"
#include "tests/support/random_rigs.h"

namespace lenticule::optics {
namespace {

using test::eye_in;
using test::oracle_zone_sees;

struct NamedRig {
  std::string name;
  Rig rig;
  double least_found = 0.8;  ///< least share of the unseen subpixels that must be found
};

/// Returns a rig of few pixels with lobes of 160 mm.
Rig tiny_rig(double pitch_subpx, double slant, double sigma = 0.04) {
  Rig rig;
  rig.panel.width_px = 64;
  rig.panel.height_px = 7;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(3.0);
  rig.sheet.pitch = Subpixels(pitch_subpx);
  rig.sheet.slant = slant;
  rig.sheet.offset = Lenses(0.1);
  rig.sheet.gap = Millimetres(pitch_subpx * 600.0 / 160.0);
  rig.sheet.refraction_shape = 0.4444;
  rig.sheet.spot_sigma = Lenses(sigma);
  rig.viewing.distance = Millimetres(600.0);
  rig.viewing.height = Millimetres(30.0);
  return rig;
}

std::vector<NamedRig> tiny_rigs() {
  std::vector<NamedRig> rigs = {
      {"coarse", tiny_rig(7.7, 0.25)},           {"fine", tiny_rig(18.66, 0.141)},
      {"finest", tiny_rig(31.0, -0.3)},          {"upright", tiny_rig(24.0, 0.0, 0.02)},
      {"sharp", tiny_rig(12.0, 1.0 / 6.0, 0.0)}, {"blurred", tiny_rig(18.66, 0.141, 0.05)}};
  NamedRig aside{"aside", tiny_rig(18.66, 0.141)};
  aside.rig.viewing.centre = Millimetres(140.0);
  NamedRig shifted{"shifted colours", tiny_rig(18.66, 0.141)};
  shifted.rig.sheet.channel_offset = {Subpixels(-0.3), Subpixels(0.0), Subpixels(0.2)};
  NamedRig bent{"residual", tiny_rig(18.66, 0.141), 0.5};
  std::mt19937_64 random(5);
  bent.rig.sheet.residual = test::random_residual(random, 4, 3, 0.02);
  NamedRig cells{"cells", tiny_rig(24.0, 0.2), 0.3};
  const PixelCell even{{{1.0 / 6, 0.25}, {0.5, 0.5}, {5.0 / 6, 0.75}}};
  const PixelCell odd{{{1.0 / 6, 0.75}, {0.5, 0.5}, {5.0 / 6, 0.25}}};
  cells.rig.panel.layout = SubpixelLayout::cells(2, 1, {even, odd});
  NamedRig stacked{"stripes one above the other", tiny_rig(24.0, 0.2)};
  stacked.rig.panel.layout = SubpixelLayout::vrgb();
  for (const NamedRig& more : {aside, shifted, bent, cells, stacked}) rigs.push_back(more);
  return rigs;
}

const ViewingZone kZones[] = {{{-20.0, 20.0}, Interval{570.0, 630.0}},
                              {{-70.0, 5.0}, Interval{600.0, 600.0}},
                              {{0.0, 0.0}, Interval{480.0, 720.0}}};

TEST(ZoneVisibility, FindsMostOfWhatNoEyeSeesAndNothingElseOnTinyRigs) {
  for (const NamedRig& named : tiny_rigs()) {
    const OpticalModel model(named.rig);
    int unseen = 0, found = 0;
    for (const ViewingZone& zone : kZones) {
      const ZoneVisibility visibility(model, zone);
      ZoneVisibility::Row row;
      for (int j = 0; j < named.rig.panel.height_px; ++j) {
        visibility.evaluate(j, row);
        for (size_t s = 0; s < row.seen.size(); ++s) {
          const int at = static_cast<int>(s);
          const bool sees = oracle_zone_sees(model, zone, at / 3, j, at % 3, 33, 3);
          unseen += sees ? 0 : 1;
          found += row.seen[s] == 0 ? 1 : 0;
          ASSERT_TRUE(!sees || row.seen[s] != 0) << named.name << ": row " << j << ", " << s;
        }
      }
    }
    EXPECT_GT(unseen, 200) << named.name;
    EXPECT_GE(found, named.least_found * unseen) << named.name;
  }
}

/// Returns a zone of a part of the rig's lobe, so that some subpixels are unseen.
ViewingZone random_zone(const OpticalModel& model, std::mt19937_64& random) {
  std::uniform_real_distribution<double> part(0.0, 1.0);
  const double distance =
      std::isinf(model.rig().viewing.distance.value) ? 900.0 : model.rig().viewing.distance.value;
  const double lobe = model.lobe_width_mm(distance);
  const double middle = lobe * (part(random) - 0.5), width = 0.4 * lobe * part(random);
  const double depth = 0.03 * distance * part(random);
  return {{middle - width / 2, middle + width / 2}, Interval{distance - depth, distance + depth}};
}

TEST(ZoneVisibility, HidesNothingThatAnEyeSeesOnRandomRigs) {
  std::mt19937_64 random(11);
  int rigs_with_unseen = 0;
  for (int n = 0; n < 60; ++n) {
    const OpticalModel model(n < 6 ? test::kiosk_rig() : test::random_rig(random));
    const Panel& panel = model.rig().panel;
    const ViewingZone zone = random_zone(model, random);
    const ZoneVisibility visibility(model, zone);
    ZoneVisibility::Row row;
    int checked = 0;
    for (int k = 0; k < 6; ++k) {
      const int j = k < 2 ? k * (panel.height_px - 1)
                          : static_cast<int>(random() % static_cast<uint64_t>(panel.height_px));
      visibility.evaluate(j, row);
      for (int tries = 0; tries < 400 && checked < 10 * (k + 1); ++tries) {
        const auto s = random() % row.seen.size();
        if (row.seen[s] != 0) continue;
        ++checked;
        const int at = static_cast<int>(s);
        ASSERT_FALSE(oracle_zone_sees(model, zone, at / 3, j, at % 3, 9, 3))
            << "rig " << n << ", row " << j << ", " << s;
      }
    }
    rigs_with_unseen += checked > 0 ? 1 : 0;
  }
  EXPECT_GT(rigs_with_unseen, 20);
}

TEST(ZoneVisibility, EyesInTheZoneSeeTheSamePictureWithoutTheOtherSubpixels) {
  std::mt19937_64 random(7);
  for (const NamedRig& named : tiny_rigs()) {
    const OpticalModel model(named.rig);
    const Panel& panel = named.rig.panel;
    const auto row_bytes = 3 * static_cast<size_t>(panel.width_px);
    for (const ViewingZone& zone : kZones) {
      const ZoneVisibility visibility(model, zone);
      std::vector<uint8_t> all(row_bytes * static_cast<size_t>(panel.height_px));
      for (uint8_t& code : all) code = static_cast<uint8_t>(1 + random() % 255);
      std::vector<uint8_t> seen = all;
      ZoneVisibility::Row row;
      for (int j = 0; j < panel.height_px; ++j) {
        visibility.evaluate(j, row);
        for (size_t s = 0; s < row_bytes; ++s)
          seen[static_cast<size_t>(j) * row_bytes + s] *= row.seen[s];
      }
      const auto picture = [&](const std::vector<uint8_t>& codes, const Eye& eye) {
        return simulate_eye(model, {codes.data(), panel.width_px, panel.height_px, row_bytes}, eye,
                            {.width = 4 * panel.width_px, .height = 4 * panel.height_px})
            .pixels;
      };
      for (int n = 0; n < 12; ++n) {
        const double right = n < 4 ? n % 2 : static_cast<double>(random() % 1001) / 1000.0;
        const double far = n < 4 ? n / 2 : static_cast<double>(random() % 1001) / 1000.0;
        const Eye eye = eye_in(model, zone, right, far);
        ASSERT_EQ(picture(all, eye), picture(seen, eye))
            << named.name << " from " << eye.x << ", " << eye.z_mm;
      }
      Eye elsewhere = eye_in(model, zone, 0.5, 0.5);
      elsewhere.x += 0.5 * model.lobe_width_mm(elsewhere.z_mm);
      if (all != seen) {
        EXPECT_NE(picture(all, elsewhere), picture(seen, elsewhere)) << named.name;
      }
    }
  }
}

TEST(ZoneVisibility, ReachesFivePercentNearerAndFartherThanTheViewingLineUnlessStated) {
  const OpticalModel model(tiny_rig(18.66, 0.141));
  const ZoneVisibility stated(model, {{-20.0, 20.0}, Interval{570.0, 630.0}});
  const ZoneVisibility unstated(model, {{-20.0, 20.0}});
  ZoneVisibility::Row a, b;
  for (int j = 0; j < 7; ++j) {
    stated.evaluate(j, a);
    unstated.evaluate(j, b);
    EXPECT_EQ(a.seen, b.seen);
  }
}

TEST(ZoneVisibility, NeedsDistancesIfTheViewingLineIsInfinitelyFar) {
  const OpticalModel model(test::upright_rig());
  EXPECT_THROW(ZoneVisibility(model, {{-20.0, 20.0}}), Error);
  EXPECT_NO_THROW(ZoneVisibility(model, {{-20.0, 20.0}, Interval{500.0, 600.0}}));
}

TEST(ZoneVisibility, IsReadFromText) {
  EXPECT_EQ(to_text(parse_viewing_zone("60")), "-60:60");
  EXPECT_EQ(to_text(parse_viewing_zone("-20.5:80")), "-20.5:80");
  EXPECT_EQ(to_text(parse_viewing_zone("0@650:750")), "0:0@650:750");
  for (const char* text : {"", "x", "-5", "80:-20", "60@", "60@700", "60@0:700", "60@750:650",
                           "nan", "inf", "1:2:3", "60mm", "60@650:750@", "1e9", "60@650:1e9"})
    EXPECT_THROW((void)parse_viewing_zone(text), Error) << text;
}

}  // namespace
}  // namespace lenticule::optics
