// SPDX-License-Identifier: Apache-2.0
// Tests the path from frames to eyes: which eye sees which view, and that left stays left up to the
// edges of the panel.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "optics/eye_simulator.h"
#include "optics/row_rays.h"
#include "tests/support/oracles/seen_column.h"
#include "tests/support/random_rigs.h"

namespace lenticule::optics {
namespace {

struct Frame {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;

  [[nodiscard]] RgbView view() const {
    return {pixels.data(), width, height, 3 * static_cast<size_t>(width)};
  }
};

int number_at(double place, int views) {
  return std::clamp(static_cast<int>(view_number(place, views)), 0, views - 1);
}
uint8_t code_of(int number) { return static_cast<uint8_t>(40 + 20 * number); }

/// Returns a frame in which every subpixel has the number of its view.
Frame numbered_frame(const OpticalModel& model, int views) {
  const Panel& panel = model.rig().panel;
  Frame frame{panel.width_px, panel.height_px, {}};
  const RowRayEvaluator evaluator(model);
  RowRays rays;
  for (int j = 0; j < panel.height_px; ++j) {
    evaluator.evaluate(j, 0, panel.width_px, rays);
    for (const double place : rays.place) frame.pixels.push_back(code_of(number_at(place, views)));
  }
  return frame;
}

Eye eye_of_view(const OpticalModel& model, int view, int views) {
  const double aside = (view + 0.5) / views - 0.5;
  Eye eye = model.design_eye();
  eye.x = std::isinf(eye.z_mm) ? aside * model.pitch_mm() / model.rig().sheet.gap.value
                               : aside * model.lobe_width_mm(eye.z_mm);
  return eye;
}

/// Returns the share of the samples that show the number, among those through which the eye sees
/// the panel.
double share_showing(const RgbPicture& picture, int number) {
  long right = 0, seen = 0;
  for (const uint8_t code : picture.pixels) {
    seen += code != 0 ? 1 : 0;
    right += code == code_of(number) ? 1 : 0;
  }
  return static_cast<double>(right) / static_cast<double>(seen);
}

TEST(NumberedViews, AreSeenByTheSimulatorFromTheirEyes) {
  const OpticalModel upright(test::upright_rig());
  const Frame four = numbered_frame(upright, 4);
  for (int k = 0; k < 4; ++k) {
    const RgbPicture picture = simulate_eye(upright, four.view(), eye_of_view(upright, k, 4));
    EXPECT_GE(share_showing(picture, k), 0.999) << "view " << k;
  }
}

/// Returns the share of lenses that show `expected`. Looks at the views of a stereo pair that the
/// lenses at the left and right 5 % of the panel show to the eye at `x_mm`, with lobes chosen by
/// `place_of(i, j, c)`.
template <class PlaceOf>
double share_at_edges(const OpticalModel& model, double x_mm, int expected,
                      const PlaceOf& place_of) {
  const Eye eye{x_mm, 0.0, 700.0};
  const int w = model.rig().panel.width_px;
  long lenses = 0, right = 0;
  for (int j = 3; j < 2160; j += 97) {
    const auto first = static_cast<int64_t>(model.phase(0, j, 1, eye)) + 1;
    const auto last = static_cast<int64_t>(model.phase(w, j, 1, eye)) - 1;
    for (int64_t lens = first; lens <= last; ++lens) {
      const int i = seen_column(model, lens, j, 1, eye);
      if (i < 0 || (i > w / 20 && i < w - w / 20)) continue;
      ++lenses;
      right += number_at(place_of(i, j, 1), 2) == expected ? 1 : 0;
    }
  }
  EXPECT_GT(lenses, 1000);
  return static_cast<double>(right) / static_cast<double>(lenses);
}

TEST(LeftAndRight, KeepTheirOrderAtTheEdgesOfAWidePanel) {
  const OpticalModel model(test::kiosk_rig());
  const auto place = [&](int i, int j, int c) { return model.ray(i, j, c).place; };
  EXPECT_GE(share_at_edges(model, -32.0, 0, place), 0.999);
  EXPECT_GE(share_at_edges(model, 32.0, 1, place), 0.999);
}

TEST(ViewNumber, GrowsWithTheViewersXAcrossOneLens) {
  const OpticalModel model(test::kiosk_rig());
  for (const int j : {0, 1080, 2159}) {
    for (const int start : {0, 1900, 3820}) {
      for (int i = start; i < start + 18; ++i) {
        const SubpixelRay a = model.ray(i, j, 0), b = model.ray(i, j, 1);
        if (a.lens != b.lens) continue;
        ASSERT_GT(view_number(a.place, 8), view_number(b.place, 8));
        ASSERT_GT(a.lens_x_mm + 700.0 * a.tan_x, b.lens_x_mm + 700.0 * b.tan_x);
      }
    }
  }
}

}  // namespace
}  // namespace lenticule::optics
