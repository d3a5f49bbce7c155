// SPDX-License-Identifier: Apache-2.0
// Tests the fast weaver against the reference: all rigs of a tiny family, random large ones, and
// every kernel that this machine supports.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "frames/srgb.h"
#include "frames/weaving/crosstalk.h"
#include "frames/weaving/fast_weaver.h"
#include "lab/reference_weaver.h"
#include "tests/support/weave_rigs.h"

namespace lenticule::frames {
namespace {

using lab::weave;

using optics::SubpixelLayout;
using test::weave_noise;
using test::weave_rig;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

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

/// Records which kernels were compared with the plain one, so that a test cannot pass without a
/// comparison.
class Compared {
 public:
  void note(WeaveKernel kernel) { ++count_[kernel]; }

  /// Queries the processor directly instead of using the code under test.
  void expect_all_kernels_of_this_machine() const {
    const int plans = count_of(WeaveKernel::Transposed);
    EXPECT_GT(plans, 0);
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2")) {
      EXPECT_EQ(count_of(WeaveKernel::Avx2), plans);
    }
    if (__builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vbmi") &&
        __builtin_cpu_supports("avx512vnni")) {
      EXPECT_GT(count_of(WeaveKernel::Permute), 0);
    }
#elif defined(__aarch64__)
    EXPECT_EQ(count_of(WeaveKernel::Neon), plans);
#endif
  }

 private:
  [[nodiscard]] int count_of(WeaveKernel kernel) const {
    const auto at = count_.find(kernel);
    return at == count_.end() ? 0 : at->second;
  }
  std::map<WeaveKernel, int> count_;
};

/// Expects all kernels to agree and to be within one level of the reference.
void expect_like_reference(const optics::Rig& rig, const ViewSet& views,
                           const WeaveOptions& options, Compared& compared) {
  const optics::OpticalModel model(rig);
  const WeavePlan plan(model, shape_of(views), options);
  const WovenFrame plain = woven_by(plan, views, WeaveKernel::Plain);
  ASSERT_LE(furthest(plain, weave(views, model, options)), 1)
      << rig.panel.width_px << "x" << rig.panel.height_px << " pitch " << rig.sheet.pitch.value
      << " slant " << rig.sheet.slant << " " << rig.panel.layout.name() << " "
      << to_string(plan.options().filter.value()) << " " << to_string(options.fit);
  for (const WeaveKernel kernel : kWeaveKernels) {
    if (kernel == WeaveKernel::Plain || !kernel_suits(kernel, plan)) continue;
    ASSERT_EQ(woven_by(plan, views, kernel), plain)
        << to_string(kernel) << " pitch " << rig.sheet.pitch.value;
    compared.note(kernel);
  }
  ASSERT_EQ(woven_by(plan, views, best_kernel(plan), 3), plain) << "shared among threads";
}

TEST(FastWeave, IsWithinALevelOfTheReferenceOnAllTinyRigs) {
  Compared compared;
  for (const auto& [width, height] : {std::pair{12, 8}, std::pair{5, 9}, std::pair{70, 3}})
    for (const double pitch : {3.3, 7.71, 24.04})
      for (const double slant : {0.0, 0.2513, -1.0})
        for (const SubpixelLayout& layout : {SubpixelLayout::rgb(), SubpixelLayout::bgr(),
                                             SubpixelLayout::vrgb(), test::two_over_one()})
          for (const double distance : {kInfinity, 300.0})
            for (const test::WeaveSetting& setting : test::weave_settings()) {
              const optics::Rig rig = weave_rig(width, height, pitch, slant, distance, layout);
              const ViewSet views(setting.noise(), setting.layout);
              expect_like_reference(rig, views, setting.options, compared);
              if (HasFailure()) return;
            }
  compared.expect_all_kernels_of_this_machine();
}

TEST(FastWeave, IsWithinALevelOfTheReferenceOnLargeRigs) {
  Compared compared;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int n = 0; n < 10; ++n) {
    const int width = n % 3 == 0 ? 1080 : 3840, height = n % 3 == 0 ? 180 : 60;
    optics::Rig rig = weave_rig(width, height, 4.0 + 20.0 * unit(random), 2.0 * unit(random) - 1.0,
                                n % 4 == 0 ? kInfinity : 700.0,
                                n % 2 ? SubpixelLayout::bgr() : SubpixelLayout::rgb());
    rig.sheet.offset = Lenses(unit(random));
    rig.sheet.gap = Millimetres(2.0 * rig.sheet.pitch.value * 0.2 / 3.0);
    if (n == 5) rig.sheet.channel_offset = {Subpixels(0.05), Subpixels(0.0), Subpixels(-0.08)};
    if (n >= 8) rig.sheet.residual = {.columns = 5, .rows = 4, .lenses = {}};
    for (int knot = 0; n >= 8 && knot < 20; ++knot)
      rig.sheet.residual.lenses.push_back(0.2 * unit(random));
    // The picture is steep: columns must be right to a thousandth of a pixel.
    const ViewSet views(weave_noise(9 * 160, 5 * (n == 1 ? 90 : 45), 3), {.columns = 9, .rows = 5});
    expect_like_reference(rig, views,
                          {.filter = n % 5 == 3 ? ViewFilter::Nearest : ViewFilter::Linear,
                           .fit = n % 2 ? PictureFit::Stretch : PictureFit::Contain},
                          compared);
    ASSERT_FALSE(HasFailure()) << "rig " << n;
  }
  compared.expect_all_kernels_of_this_machine();
}

TEST(FastWeave, GivesTheReferencesBytesForOnePixelViews) {
  // Views of one pixel each: no position in the picture mixes pixels.
  for (const double pitch : {3.0, 6.0, 7.71, 24.04})
    for (const double slant : {0.0, 1.0 / 3.0, 0.2513, -0.14})
      for (const SubpixelLayout& layout : {SubpixelLayout::rgb(), SubpixelLayout::bgr()}) {
        const optics::Rig rig = weave_rig(400, 41, pitch, slant, kInfinity, layout);
        const optics::OpticalModel model(rig);
        const ViewSet views(weave_noise(9, 5, 5), {.columns = 9, .rows = 5, .views = 43});
        const WeaveOptions options{.filter = ViewFilter::Nearest, .fit = PictureFit::Stretch};
        const WeavePlan plan(model, shape_of(views), options);
        const WovenFrame expected = weave(views, model, options);
        for (const WeaveKernel kernel : kWeaveKernels) {
          if (!kernel_suits(kernel, plan)) continue;
          EXPECT_EQ(woven_by(plan, views, kernel), expected) << pitch << " " << slant;
        }
      }
}

/// Returns all bytes that weaving reads from a plan.
std::vector<uint8_t> bytes_of(const WeavePlan& plan) {
  std::vector<uint8_t> bytes;
  const auto append = [&](const auto& value) {
    const auto* const from = reinterpret_cast<const uint8_t*>(&value);
    bytes.insert(bytes.end(), from, from + sizeof value);
  };
  for (int index = 0; index < plan.block_count(); ++index) {
    const WeavePlan::Block block = plan.block(index);
    for (const WeavePlan::Bar& bar : block.bars) append(bar);
    for (const weave_kernel::Set& set : block.sets) {
      append(set.first);
      append(set.row);
      append(set.row_share);
      for (uint32_t quad = set.quads_begin; quad < set.quads_end; ++quad) append(block.quads[quad]);
    }
  }
  return bytes;
}

TEST(FastWeave, PlansTheSameWithEveryInstructionSetAndNumberOfThreads) {
  int compared = 0;
  for (const double pitch : {3.3, 7.71, 24.04})
    for (const SubpixelLayout& layout : {SubpixelLayout::rgb(), SubpixelLayout::bgr(),
                                         SubpixelLayout::vrgb(), test::two_over_one()})
      for (const ViewFilter filter : {ViewFilter::Nearest, ViewFilter::Linear, ViewFilter::Gauss})
        for (const PictureFit fit : {PictureFit::Contain, PictureFit::Cover}) {
          const optics::Rig rig = weave_rig(70, 230, pitch, 0.2513, 300.0, layout);
          const optics::OpticalModel model(rig);
          const ViewShape shape{.count = 43, .width = 31, .height = 17, .aspect = 1.2};
          const WeaveOptions options{.filter = filter, .fit = fit};
          const std::vector<uint8_t> plain =
              bytes_of(WeavePlan(model, shape, options, 1, Isa::Baseline));
          ASSERT_FALSE(plain.empty());
          EXPECT_EQ(bytes_of(WeavePlan(model, shape, options, 3, Isa::Baseline)), plain);
          for (const Isa isa : {Isa::Neon, Isa::Avx2, Isa::Avx512}) {
            if (!isa_supported(isa)) continue;
            EXPECT_EQ(bytes_of(WeavePlan(model, shape, options, 1, isa)), plain)
                << isa_name(isa) << " " << layout.name() << " " << to_string(filter);
            ++compared;
          }
        }
  if (isa_supported(Isa::Neon) || isa_supported(Isa::Avx2)) {
    EXPECT_GT(compared, 0);
  }
}

TEST(FastWeave, KeepsEveryUniformPicture) {
  const optics::OpticalModel model(weave_rig(200, 30, 7.71, 0.2513, 600.0));
  for (int code = 0; code < 256; ++code) {
    WovenFrame quilt({.width = 30, .height = 20});
    std::fill(quilt.bytes().begin(), quilt.bytes().end(), static_cast<uint8_t>(code));
    const ViewSet views(quilt, {.columns = 3, .rows = 2});
    const WovenFrame woven = weave_fast(views, model, {.fit = PictureFit::Stretch});
    for (const uint8_t byte : woven.bytes()) ASSERT_EQ(byte, code);
  }
}

/// Tries all widths around that of a block that is transposed at once: none may read beyond its
/// row.
TEST(FastWeave, TransposesViewsOfEveryWidth) {
  Compared compared;
  for (int width = 1; width <= 36; ++width)
    for (const int views : {1, 15, 16, 17, 33}) {
      const optics::Rig rig = weave_rig(40, 9, 7.71, 0.2513, 300.0);
      const ViewSet set(weave_noise(width * views, 3, 23), {.columns = views, .rows = 1});
      expect_like_reference(rig, set, {.fit = PictureFit::Stretch}, compared);
      ASSERT_FALSE(HasFailure()) << width << " wide, " << views << " views";
    }
  compared.expect_all_kernels_of_this_machine();
}

TEST(FastWeave, UsesTheBestRequestedKernel) {
  const optics::OpticalModel model(weave_rig(40, 9, 7.71, 0.2513, 300.0));
  const auto plan = [&](int width, ViewFilter filter) {
    return WeavePlan(model, {.count = 5, .width = width, .height = 9, .aspect = 1.0},
                     {.filter = filter});
  };
  EXPECT_EQ(best_kernel(plan(40, ViewFilter::Linear), Isa::Baseline), WeaveKernel::Transposed);
  EXPECT_EQ(best_kernel(plan(4000, ViewFilter::Linear), Isa::Avx512), WeaveKernel::Plain)
      << "views of far more pixels than the panel's";
  if (isa_supported(Isa::Neon)) {
    EXPECT_EQ(best_kernel(plan(40, ViewFilter::Linear), Isa::Neon), WeaveKernel::Neon);
  }
  if (!isa_supported(Isa::Avx2)) return;
  EXPECT_EQ(best_kernel(plan(40, ViewFilter::Linear), Isa::Avx2), WeaveKernel::Avx2);
  EXPECT_EQ(best_kernel(plan(40, ViewFilter::Gauss), Isa::Avx512), WeaveKernel::Avx2);
}

TEST(FixedLight, IsAParabolaNearTheExactLight) {
  for (size_t code = 0; code < 256; ++code)
    EXPECT_NEAR(light_of_codes15()[code], 32767.0 * linear_of_codes()[code], 1.6) << code;
  EXPECT_EQ(light_of_codes15()[0], 0);
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
