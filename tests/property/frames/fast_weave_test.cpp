// SPDX-License-Identifier: Apache-2.0
// The fast weaver against the reference: all of a family of tiny rigs, large ones at random, every
// kernel that this machine has.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "frames/srgb.h"
#include "frames/weaving/fast_weaver.h"
#include "frames/weaving/fixed_light.h"

namespace lenticule::frames {
namespace {

using optics::SubpixelLayout;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

WovenFrame noise(int width, int height, uint32_t seed) {
  WovenFrame frame({.width = width, .height = height});
  std::mt19937 random(seed);
  // Black and white beside each other are the hardest; anything else occurs too.
  for (uint8_t& byte : frame.bytes()) {
    const auto r = static_cast<uint32_t>(random());
    byte = static_cast<uint8_t>((r & 0x100) != 0 ? ((r & 0x200) != 0 ? 255 : 0) : r);
  }
  return frame;
}

optics::Rig rig_of(int width, int height, double pitch, double slant, double distance,
                   const SubpixelLayout& layout = SubpixelLayout::rgb()) {
  optics::Rig rig;
  rig.name = "fast";
  rig.panel = {.width_px = width,
               .height_px = height,
               .pixel_width = Millimetres(0.2),
               .pixel_height = Millimetres(0.2),
               .layout = layout};
  rig.sheet.pitch = Subpixels(pitch);
  rig.sheet.slant = slant;
  rig.sheet.offset = Lenses(0.31);
  rig.sheet.gap = Millimetres(1.6);
  rig.sheet.refraction_shape = 0.44;
  rig.sheet.spot_sigma = Lenses(0.08);
  rig.viewing = {.height = Millimetres(20.0), .distance = Millimetres(distance)};
  return rig;
}

SubpixelLayout two_over_one() {
  return SubpixelLayout::cells(
      2, 1,
      {{{{0.25, 0.25}, {0.75, 0.25}, {0.5, 0.75}}}, {{{0.25, 0.75}, {0.75, 0.75}, {0.5, 0.25}}}});
}

WovenFrame woven_by(const WeavePlan& plan, const ViewSet& views, WeaveKernel kernel,
                    int threads = 1) {
  WovenFrame frame(plan.geometry());
  FastWeaver(std::shared_ptr<const WeavePlan>(&plan, [](const WeavePlan*) {}), threads, kernel)
      .weave(views, frame);
  return frame;
}

int furthest(const WovenFrame& a, const WovenFrame& b) {
  int most = 0;
  for (size_t n = 0; n < a.bytes().size(); ++n)
    most = std::max(most, std::abs(a.bytes()[n] - b.bytes()[n]));
  return most;
}

/// All kernels agree, and are within a level of the reference.
void expect_like_reference(const optics::Rig& rig, const ViewSet& views,
                           const WeaveOptions& options) {
  const optics::OpticalModel model(rig);
  const WeavePlan plan(model, shape_of(views), options);
  const WovenFrame plain = woven_by(plan, views, WeaveKernel::Plain);
  ASSERT_LE(furthest(plain, weave(views, model, options)), 1)
      << rig.panel.width_px << "x" << rig.panel.height_px << " pitch " << rig.sheet.pitch.value
      << " slant " << rig.sheet.slant << " " << rig.panel.layout.name() << " "
      << to_string(options.filter) << " " << to_string(options.fit);
  const WeaveKernel best = best_kernel(plan);
  if (best != WeaveKernel::Plain) {
    ASSERT_EQ(woven_by(plan, views, best), plain) << "pitch " << rig.sheet.pitch.value;
    ASSERT_EQ(woven_by(plan, views, best, 3), plain) << "shared among threads";
  }
}

struct Setting {
  QuiltLayout layout;
  WeaveOptions options;
};
const Setting kSettings[] = {
    {{.columns = 3, .rows = 2}, {.filter = ViewFilter::Nearest}},
    {{.columns = 3, .rows = 2, .views = 5}, {.filter = ViewFilter::Linear}},
    {{.columns = 1, .rows = 7}, {.filter = ViewFilter::Nearest, .order = ViewOrder::RightToLeft}},
    {{.columns = 7, .rows = 1, .views = 0, .aspect = 3.0},
     {.filter = ViewFilter::Linear, .fit = PictureFit::Cover}},
    {{.columns = 2, .rows = 4, .views = 8, .aspect = 0.4},
     {.filter = ViewFilter::Gauss, .fit = PictureFit::Contain, .order = ViewOrder::RightToLeft}},
    {{.columns = 1, .rows = 1}, {.filter = ViewFilter::Linear, .fit = PictureFit::Stretch}},
    {{.columns = 8, .rows = 8, .views = 64, .aspect = 4.0},
     {.filter = ViewFilter::Linear, .fit = PictureFit::Contain}},
    {{.columns = 9, .rows = 8, .views = 70}, {.filter = ViewFilter::Linear}},
};

TEST(FastWeave, IsWithinALevelOfTheReferenceOnAllTinyRigs) {
  for (const auto& [width, height] : {std::pair{12, 8}, std::pair{5, 9}, std::pair{70, 3}})
    for (const double pitch : {3.3, 7.71, 24.04})
      for (const double slant : {0.0, 0.2513, -1.0})
        for (const SubpixelLayout& layout :
             {SubpixelLayout::rgb(), SubpixelLayout::bgr(), SubpixelLayout::vrgb(), two_over_one()})
          for (const double distance : {kInfinity, 300.0})
            for (const Setting& setting : kSettings) {
              const optics::Rig rig = rig_of(width, height, pitch, slant, distance, layout);
              const ViewSet views(noise(setting.layout.columns * 7, setting.layout.rows * 5, 17),
                                  setting.layout);
              expect_like_reference(rig, views, setting.options);
              if (HasFailure()) return;
            }
}

TEST(FastWeave, IsWithinALevelOfTheReferenceOnLargeRigs) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int n = 0; n < 10; ++n) {
    const int width = n % 3 == 0 ? 1080 : 3840, height = n % 3 == 0 ? 180 : 60;
    optics::Rig rig = rig_of(width, height, 4.0 + 20.0 * unit(random), 2.0 * unit(random) - 1.0,
                             n % 4 == 0 ? kInfinity : 700.0,
                             n % 2 ? SubpixelLayout::bgr() : SubpixelLayout::rgb());
    rig.sheet.offset = Lenses(unit(random));
    rig.sheet.gap = Millimetres(2.0 * rig.sheet.pitch.value * 0.2 / 3.0);
    if (n == 5) rig.sheet.channel_offset = {Subpixels(0.05), Subpixels(0.0), Subpixels(-0.08)};
    if (n >= 8) rig.sheet.residual = {.columns = 5, .rows = 4, .lenses = {}};
    for (int knot = 0; n >= 8 && knot < 20; ++knot)
      rig.sheet.residual.lenses.push_back(0.2 * unit(random));
    // Steep in the picture: columns must be right to a thousandth of a pixel.
    const ViewSet views(noise(9 * 160, 5 * (n == 1 ? 90 : 45), 3), {.columns = 9, .rows = 5});
    expect_like_reference(rig, views,
                          {.filter = n % 5 == 3 ? ViewFilter::Nearest : ViewFilter::Linear,
                           .fit = n % 2 ? PictureFit::Stretch : PictureFit::Contain});
    ASSERT_FALSE(HasFailure()) << "rig " << n;
  }
}

TEST(FastWeave, GivesTheReferencesBytesWhereOnePixelCounts) {
  // Views of one pixel each: whatever the place in the picture, nothing is mixed.
  for (const double pitch : {3.0, 6.0, 7.71, 24.04})
    for (const double slant : {0.0, 1.0 / 3.0, 0.2513, -0.14})
      for (const SubpixelLayout& layout : {SubpixelLayout::rgb(), SubpixelLayout::bgr()}) {
        const optics::Rig rig = rig_of(400, 41, pitch, slant, kInfinity, layout);
        const optics::OpticalModel model(rig);
        const ViewSet views(noise(9, 5, 5), {.columns = 9, .rows = 5, .views = 43});
        const WeaveOptions options{.filter = ViewFilter::Nearest, .fit = PictureFit::Stretch};
        const WeavePlan plan(model, shape_of(views), options);
        const WovenFrame expected = weave(views, model, options);
        EXPECT_EQ(woven_by(plan, views, WeaveKernel::Plain), expected) << pitch << " " << slant;
        EXPECT_EQ(woven_by(plan, views, best_kernel(plan)), expected) << pitch << " " << slant;
      }
}

TEST(FastWeave, LeavesEveryEvenPictureAsItIs) {
  const optics::OpticalModel model(rig_of(200, 30, 7.71, 0.2513, 600.0));
  for (int code = 0; code < 256; ++code) {
    WovenFrame quilt({.width = 30, .height = 20});
    std::fill(quilt.bytes().begin(), quilt.bytes().end(), static_cast<uint8_t>(code));
    const ViewSet views(quilt, {.columns = 3, .rows = 2});
    const WovenFrame woven = weave_fast(views, model, {.fit = PictureFit::Stretch});
    for (const uint8_t byte : woven.bytes()) ASSERT_EQ(byte, code);
  }
}

TEST(FixedLight, EncodesWithinAThirdOfALevel) {
  for (int code = 0; code < 256; ++code)
    EXPECT_EQ(codes_of_light15()[light_of_codes15()[static_cast<size_t>(code)]], code);
  for (int light = 0; light < 32768; ++light) {
    const double exact = 255.0 * srgb_from_linear(light / 32767.0);
    EXPECT_NEAR(codes_of_light15()[static_cast<size_t>(light)], exact, 0.5 + 0.2) << light;
  }
}

}  // namespace
}  // namespace lenticule::frames
