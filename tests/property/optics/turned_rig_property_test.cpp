// SPDX-License-Identifier: Apache-2.0
// Tests that a turned rig describes the same panel: each subpixel sends the same light to the same
// eye, as the reference implementation finds it for the rig before the turn.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>

#include "base/error.h"
#include "optics/eye_simulator.h"
#include "optics/rig.h"
#include "optics/row_rays.h"
#include "tests/support/noise_frame.h"
#include "tests/support/oracles/optics_oracle.h"
#include "tests/support/random_rigs.h"
#include "tests/support/turned_picture.h"

namespace lenticule::optics {
namespace {

/// Returns a random rig that can be turned; none if the candidate cannot.
std::optional<Rig> turnable_rig(std::mt19937_64& random, const Mounting& mounting) {
  Rig rig = test::random_rig(random);
  // A map read at points shifted by the channel offsets cannot be turned exactly.
  if (mounting.swapped && !rig.sheet.residual.empty()) rig.sheet.channel_offset = {};
  try {
    (void)turned_rig(rig, mounting);
    return rig;
  } catch (const Error&) {
    return std::nullopt;
  }
}

struct Subpixel {
  int i;
  int j;
  int channel;
};

Subpixel random_subpixel(std::mt19937_64& random, const Panel& panel) {
  return {static_cast<int>(random() % static_cast<uint64_t>(panel.width_px)),
          static_cast<int>(random() % static_cast<uint64_t>(panel.height_px)),
          static_cast<int>(random() % 3)};
}

class TurnedRigProperty : public testing::TestWithParam<const char*> {
 protected:
  const Mounting mounting = mounting_named(GetParam());
  std::mt19937_64 random{99};

  /// Returns the same subpixel of the turned panel.
  [[nodiscard]] Subpixel seen(const Subpixel& sent, const Rig& turned) const {
    const PixelPlace at =
        mounting.seen_place({sent.i, sent.j}, {turned.panel.width_px, turned.panel.height_px});
    return {at.column, at.row, sent.channel};
  }

  static Vec2 place_mm(const Panel& panel, const Subpixel& s) {
    const Vec2 px = panel.subpixel_centre_px(s.i, s.j, s.channel);
    return {panel.x_mm(px.x), panel.y_mm(px.y)};
  }
};

TEST_P(TurnedRigProperty, HasEverySubpixelAtTheTurnedPlace) {
  for (int r = 0; r < 300; ++r) {
    const auto rig = turnable_rig(random, mounting);
    if (!rig) continue;
    const Rig turned = turned_rig(*rig, mounting);
    for (int n = 0; n < 20; ++n) {
      const Subpixel s = random_subpixel(random, rig->panel);
      const Vec2 wanted = test::seen_point(place_mm(rig->panel, s), GetParam());
      const Vec2 found = place_mm(turned.panel, seen(s, turned));
      ASSERT_NEAR(found.x, wanted.x, 1e-9);
      ASSERT_NEAR(found.y, wanted.y, 1e-9);
    }
  }
}

TEST_P(TurnedRigProperty, ShowsEachSubpixelToTheSameEye) {
  int rigs = 0;
  for (int r = 0; r < 400; ++r) {
    const auto rig = turnable_rig(random, mounting);
    if (!rig) continue;
    ++rigs;
    const Rig turned = turned_rig(*rig, mounting);
    const OpticalModel model(turned);
    double sign = 0.0;  // the lenses may be numbered from the other end, all of them
    for (int n = 0; n < 20; ++n) {
      const Subpixel s = random_subpixel(random, rig->panel);
      const auto offset = [&] { return static_cast<double>(random() % 600) - 300.0; };
      const Vec2 eye{offset(), offset()};
      const Vec2 seen_eye = test::seen_point(eye, GetParam());
      const Vec2 at = rig->panel.subpixel_centre_px(s.i, s.j, s.channel);
      const auto wanted = static_cast<double>(
          test::oracle_phase(*rig, {at.x, at.y}, s.channel, {eye.x, eye.y, 700.0L}));
      const Subpixel t = seen(s, turned);
      const Vec2 seen_at = turned.panel.subpixel_centre_px(t.i, t.j, t.channel);
      const double found =
          model.phase(seen_at.x, seen_at.y, t.channel, {seen_eye.x, seen_eye.y, 700.0});
      if (sign == 0.0 && std::abs(wanted) > 1e-6) sign = found / wanted > 0.0 ? 1.0 : -1.0;
      ASSERT_NEAR(sign * found, wanted, 2e-9 * (1.0 + std::abs(wanted)))
          << "rig " << r << ", subpixel " << s.i << ", " << s.j << ", " << s.channel;
    }
  }
  EXPECT_GE(rigs, 100);
}

INSTANTIATE_TEST_SUITE_P(Mountings, TurnedRigProperty, testing::ValuesIn(test::kMountingNames));

/// The mountings that keep the viewing line along the panel's rows.
class ReversedRigProperty : public TurnedRigProperty {};

TEST_P(ReversedRigProperty, SendsTheTurnedRays) {
  RowRays rays;
  for (int r = 0; r < 300; ++r) {
    const Rig rig = test::random_rig(random);
    Rig turned = turned_rig(rig, mounting);
    if (mounting.reversed_rows) turned.viewing.height = Millimetres(-rig.viewing.height.value);
    if (mounting.reversed_columns) turned.viewing.centre = Millimetres(-rig.viewing.centre.value);
    const RowRayEvaluator evaluator{OpticalModel(turned)};
    for (int n = 0; n < 10; ++n) {
      const Subpixel s = random_subpixel(random, rig.panel);
      const test::RealRay wanted = test::oracle_ray(rig, s.i, s.j, s.channel);
      if (std::fabs(wanted.place) > 0.4999L) continue;  // the border belongs to one side only
      const Subpixel t = seen(s, turned);
      evaluator.evaluate(t.j, t.i, t.i + 1, rays);
      const auto c = static_cast<size_t>(t.channel);
      const auto same = [&](double x, double y, test::Real wanted_x, test::Real wanted_y) {
        const Vec2 point = test::seen_point(
            {static_cast<double>(wanted_x), static_cast<double>(wanted_y)}, GetParam());
        EXPECT_NEAR(x, point.x, 1e-8 * (1.0 + std::abs(point.x)));
        EXPECT_NEAR(y, point.y, 1e-8 * (1.0 + std::abs(point.y)));
      };
      same(rays.lens_x_mm[c], rays.lens_y_mm[c], wanted.lens_point.x, wanted.lens_point.y);
      same(rays.tan_x[c], rays.tan_y[c], wanted.tan_x, wanted.tan_y);
      ASSERT_FALSE(HasFailure()) << "rig " << r;
    }
  }
}

TEST_P(ReversedRigProperty, ShowsTheEyeTheTurnedPicture) {
  Rig rig = test::kiosk_rig();
  rig.panel.width_px = 240;
  rig.panel.height_px = 120;
  const Rig turned = turned_rig(rig, mounting);
  const frames::WovenFrame sent = test::noise_frame(240, 120, 5);
  const frames::WovenFrame woven = test::seen_of(sent, GetParam());
  const Vec2 eye{31.0, -17.0};
  const Vec2 seen_eye = test::seen_point(eye, GetParam());
  const auto picture = [](const Rig& of, const frames::WovenFrame& frame, Vec2 at) {
    const RgbPicture found = simulate_eye(
        OpticalModel(of),
        {frame.bytes().data(), frame.width(), frame.height(), frame.geometry().row_bytes()},
        {at.x, at.y, 700.0});
    frames::WovenFrame out({.width = found.width, .height = found.height});
    std::copy(found.pixels.begin(), found.pixels.end(), out.bytes().begin());
    return out;
  };
  const frames::WovenFrame wanted = test::seen_of(picture(rig, sent, eye), GetParam());
  const frames::WovenFrame found = picture(turned, woven, seen_eye);
  ASSERT_EQ(found.geometry(), wanted.geometry());
  int different = 0;
  for (size_t n = 0; n < found.bytes().size(); ++n)
    different += found.bytes()[n] != wanted.bytes()[n] ? 1 : 0;
  // Samples on the border of two lenses may fall to the other one.
  EXPECT_LE(different, static_cast<int>(found.bytes().size()) / 1000);
}

INSTANTIATE_TEST_SUITE_P(Mountings, ReversedRigProperty,
                         testing::Values("0", "180", "mirrored", "mirrored 180"));

}  // namespace
}  // namespace lenticule::optics
