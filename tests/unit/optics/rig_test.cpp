// SPDX-License-Identifier: Apache-2.0
#include "optics/rig.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "base/error.h"
#include "optics/model.h"
#include "tests/support/random_rigs.h"

namespace lenticule::optics {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct BadRig {
  const char* key;
  std::function<void(Rig&)> spoil;
};

class RigWithAProblem : public ::testing::TestWithParam<BadRig> {};

TEST_P(RigWithAProblem, IsReportedByItsKey) {
  Rig rig = test::kiosk_rig();
  GetParam().spoil(rig);
  const auto problem = find_problem(rig);
  ASSERT_TRUE(problem.has_value());
  EXPECT_EQ(problem->key, GetParam().key) << problem->cause;
  try {
    validate_rig(rig, "file.toml");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Input);
    EXPECT_EQ(std::string(error.what()).find(problem->key), 11u);  // after "file.toml: "
  }
}

const std::vector<BadRig> kBadRigs = {
    {"panel.width_px", [](Rig& r) { r.panel.width_px = 0; }},
    {"panel.height_px", [](Rig& r) { r.panel.height_px = 1 << 20; }},
    {"panel.pixel_width_mm", [](Rig& r) { r.panel.pixel_width = Millimetres(0); }},
    {"panel.pixel_height_mm", [](Rig& r) { r.panel.pixel_height = Millimetres(kNan); }},
    {"sheet.pitch_subpx", [](Rig& r) { r.sheet.pitch = Subpixels(0); }},
    {"sheet.pitch_subpx", [](Rig& r) { r.sheet.pitch = Subpixels(-7.7); }},
    {"sheet.pitch_subpx", [](Rig& r) { r.sheet.pitch = Subpixels(kNan); }},
    {"sheet.pitch_subpx", [](Rig& r) { r.sheet.pitch = Subpixels(kInfinity); }},
    {"sheet.slant", [](Rig& r) { r.sheet.slant = 5.0; }},
    {"sheet.offset_lenses", [](Rig& r) { r.sheet.offset = Lenses(kNan); }},
    {"sheet.gap_mm", [](Rig& r) { r.sheet.gap = Millimetres(-1); }},
    {"sheet.gap_mm", [](Rig& r) { r.sheet.gap = Millimetres(0); }},
    {"sheet.gap_mm", [](Rig& r) { r.sheet.gap = Millimetres(0.1); }},  // beyond the critical angle
    {"sheet.refraction_shape", [](Rig& r) { r.sheet.refraction_shape = 1.5; }},
    {"sheet.spot_sigma_lenses", [](Rig& r) { r.sheet.spot_sigma = Lenses(-0.1); }},
    {"sheet.channel_offset_subpx", [](Rig& r) { r.sheet.channel_offset[2] = Subpixels(kNan); }},
    {"sheet.residual.columns",
     [](Rig& r) {
       r.sheet.residual = {0, 3, {0.1}};
     }},
    {"sheet.residual.rows",
     [](Rig& r) {
       r.sheet.residual = {1, 1000, {0.1}};
     }},
    {"sheet.residual.lenses",
     [](Rig& r) {
       r.sheet.residual = {2, 2, {0.1}};
     }},
    {"sheet.residual.lenses",
     [](Rig& r) {
       r.sheet.residual = {1, 1, {kNan}};
     }},
    {"sheet.residual.lenses",
     [](Rig& r) {
       r.sheet.residual = {2, 1, {0.0, 400.0}};
     }},
    {"viewing.distance_mm", [](Rig& r) { r.viewing.distance = Millimetres(0); }},
    {"viewing.distance_mm", [](Rig& r) { r.viewing.distance = Millimetres(-kInfinity); }},
    {"viewing.distance_mm", [](Rig& r) { r.viewing.distance = Millimetres(kNan); }},
    {"viewing.distance_mm", [](Rig& r) { r.viewing.distance = Millimetres(1.0); }},
    {"viewing.height_mm", [](Rig& r) { r.viewing.height = Millimetres(kInfinity); }},
    {"viewing.centre_mm", [](Rig& r) { r.viewing.centre = Millimetres(kNan); }},
    {"name", [](Rig& r) { r.name = std::string(3, '\xFF'); }},
    {"name", [](Rig& r) { r.name = "\xC0\x80"; }},
    {"identity.serial", [](Rig& r) { r.identity.serial = std::string(5000, 'x'); }},
    {"provenance",
     [](Rig& r) {
       r.provenance = {{"date", "today"}, {"date", "tomorrow"}};
     }},
};
INSTANTIATE_TEST_SUITE_P(All, RigWithAProblem, ::testing::ValuesIn(kBadRigs));

TEST(ValidRig, HasAFiniteRayForEverySubpixel) {
  std::mt19937_64 random(99);
  for (int r = 0; r < 300; ++r) {
    const OpticalModel model(test::random_rig(random));
    const Panel& panel = model.rig().panel;
    for (const int i : {0, panel.width_px / 2, panel.width_px - 1}) {
      for (const int j : {0, panel.height_px / 2, panel.height_px - 1}) {
        const SubpixelRay ray = model.ray(i, j, r % 3);
        ASSERT_TRUE(std::isfinite(ray.lens_x_mm) && std::isfinite(ray.lens_y_mm));
        ASSERT_TRUE(std::isfinite(ray.tan_x) && std::isfinite(ray.tan_y));
      }
    }
  }
}

TEST(ValidRig, MayHaveTextInAnyLanguage) {
  Rig rig = test::kiosk_rig();
  rig.name = "\xE5\xB1\x95\xE7\xA4\xBA \xC3\xA9t\xC3\xA9";
  EXPECT_FALSE(find_problem(rig).has_value());
}

TEST(Fingerprint, HasSixteenHexadecimalDigits) {
  const std::string print = fingerprint(test::kiosk_rig());
  EXPECT_EQ(print.size(), 16u);
  EXPECT_EQ(print.find_first_not_of("0123456789abcdef"), std::string::npos);
}

TEST(Fingerprint, IsTheSameOnEveryMachine) {
  EXPECT_EQ(fingerprint(test::upright_rig()), "a92153edfbbe967c");
}

TEST(Fingerprint, IgnoresValuesThatDoNotChangePixels) {
  Rig rig = test::kiosk_rig();
  const std::string before = fingerprint(rig);
  rig.name = "another name";
  rig.identity.serial = "42";
  rig.provenance = {{"date", "today"}};
  rig.sheet.offset = Lenses(-0.0);
  EXPECT_EQ(fingerprint(rig), before);
}

TEST(Fingerprint, ChangesWithEveryValueThatChangesPixels) {
  const std::string before = fingerprint(test::kiosk_rig());
  const std::vector<std::function<void(Rig&)>> changes = {
      [](Rig& r) { r.panel.width_px += 1; },
      [](Rig& r) { r.panel.pixel_height = Millimetres(0.156); },
      [](Rig& r) { r.panel.layout = SubpixelLayout::bgr(); },
      [](Rig& r) { r.sheet.pitch = Subpixels(std::nextafter(r.sheet.pitch.value, 10.0)); },
      [](Rig& r) { r.sheet.slant = -r.sheet.slant; },
      [](Rig& r) { r.sheet.offset = Lenses(1e-9); },
      [](Rig& r) { r.sheet.gap = Millimetres(2.239); },
      [](Rig& r) { r.sheet.refraction_shape = 0.45; },
      [](Rig& r) { r.sheet.channel_offset[0] = Subpixels(0.01); },
      [](Rig& r) {
        r.sheet.residual = {1, 1, {0.01}};
      },
      [](Rig& r) { r.viewing.height = Millimetres(1); },
      [](Rig& r) { r.viewing.distance = Millimetres(701); },
      [](Rig& r) { r.viewing.centre = Millimetres(1); },
  };
  for (size_t n = 0; n < changes.size(); ++n) {
    Rig rig = test::kiosk_rig();
    changes[n](rig);
    EXPECT_NE(fingerprint(rig), before) << "change " << n;
  }
}

}  // namespace
}  // namespace lenticule::optics
