// SPDX-License-Identifier: Apache-2.0
// Tests the samples of soft light: the convergence of their errors.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <string>

#include "tests/support/oracles/reference_renderer.h"
#include "tests/unit/render/soft_light_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;
using test::make_tiny_stage;

struct Converging {
  const char* name;
  std::function<SoftLight(int)> options;
};

class SoftLightConverges : public ::testing::TestWithParam<Converging> {
 protected:
  [[nodiscard]] frames::WovenFrame codes(int samples) const {
    return picture(wall_and_ball(), rig_, stage_, with(GetParam().options(samples))).frame;
  }

  struct Place {
    int i, j, channel;
    double expected;
  };
  /// Returns some places where a few samples disagree, with the values of thousands of samples.
  [[nodiscard]] std::vector<Place> uncertain_places() const {
    const optics::OpticalModel model(rig_);
    const frames::WovenFrame few = codes(4), more = codes(64);
    std::vector<Place> places;
    int uncertain = 0;
    for (int j = 0; j < few.height(); ++j)
      for (int i = 0; i < few.width(); ++i)
        for (int c = 0; c < 3; ++c) {
          if (few.row(j)[3 * i + c] == more.row(j)[3 * i + c]) continue;
          if (uncertain++ % 11 != 0) continue;
          places.push_back({i, j, c,
                            test::reference_subpixel(wall_and_ball(), stage_, model, i, j, c,
                                                     {.soft = GetParam().options(4096)})});
        }
    return places;
  }

  const optics::Rig rig_ = make_rig({.width = 40, .height = 26, .pixel_mm = 1.5});
  const Stage stage_ = make_tiny_stage();
};

/// The convergence is at least that of independent samples: half the error for four times the rays.
TEST_P(SoftLightConverges, ToAReferenceWithThousandsOfSamples) {
  const std::vector<Place> places = uncertain_places();
  ASSERT_GT(places.size(), 150U);
  std::vector<double> errors;
  for (const int samples : {4, 16, 64, 256}) {
    const frames::WovenFrame frame = codes(samples);
    double sum = 0.0;
    for (const Place& at : places) {
      const double error = frame.row(at.j)[3 * at.i + at.channel] - at.expected;
      sum += error * error;
    }
    errors.push_back(std::sqrt(sum / static_cast<double>(places.size())));
    std::printf("%s: %zu places, %d samples: %.2f codes\n", GetParam().name, places.size(), samples,
                errors.back());
  }
  constexpr double kRounding = 0.3;  // rounding error in codes
  for (size_t k = 1; k < errors.size(); ++k) EXPECT_LE(errors[k], 0.5 * errors[k - 1] + kRounding);
  EXPECT_LE(errors[3], errors[0] / 8.0 + kRounding);
}

INSTANTIATE_TEST_SUITE_P(Kinds, SoftLightConverges,
                         ::testing::Values(Converging{"shadows", only_shadows},
                                           Converging{"occlusion", only_occlusion},
                                           Converging{"environment", only_environment}),
                         [](const auto& kind) { return std::string(kind.param.name); });

/// The errors of subpixels that an eye sees together are uncorrelated.
TEST_P(SoftLightConverges, WithUncorrelatedErrors) {
  const optics::Rig rig = make_rig({.width = 120, .height = 78, .pixel_mm = 0.5});
  const auto codes = [&](int samples) {
    return picture(wall_and_ball(), rig, stage_, with(GetParam().options(samples))).frame;
  };
  const frames::WovenFrame few = codes(4), many = codes(256);
  const auto error = [&](int row, int subpixel) {
    return static_cast<double>(int{few.row(row)[subpixel]} - int{many.row(row)[subpixel]});
  };
  struct Step {
    const char* to;
    int rows, subpixels;
  };
  // The pitch is 7.7 subpixels, so that eight steps lead to about the same view of the next lens.
  for (const Step step : {Step{"the next view", 0, 1}, Step{"the next of its channel", 0, 3},
                          Step{"the next lens", 0, 8}, Step{"the next row", 1, 0},
                          Step{"the same view below", 1, -1}}) {
    double product = 0.0, squares = 0.0;
    int pairs = 0;
    for (int j = 0; j + step.rows < few.height(); ++j)
      for (int s = 1; s + 8 < 3 * few.width(); ++s) {
        const double here = error(j, s), there = error(j + step.rows, s + step.subpixels);
        if (here == 0.0 || there == 0.0) continue;
        product += here * there;
        squares += 0.5 * (here * here + there * there);
        ++pairs;
      }
    ASSERT_GT(pairs, 800);
    std::printf("%s: %s: correlation %.3f of %d pairs\n", GetParam().name, step.to,
                product / squares, pairs);
    EXPECT_LT(std::abs(product / squares), 0.1) << step.to;
  }
}

}  // namespace
}  // namespace lenticule::render
