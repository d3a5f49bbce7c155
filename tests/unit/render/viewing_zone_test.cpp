// SPDX-License-Identifier: Apache-2.0
// Tests that subpixels that no eye of a zone sees are black, and that all others are rendered as
// without a zone.
#include "optics/zone/viewing_zone.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "base/error.h"
#include "optics/eye_simulator.h"
#include "render/make_method.h"
#include "render/methods/adaptive/method_adaptive.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using testing::make_rig;
using testing::make_tiny_stage;

const optics::ViewingZone kZone{{-60.0, 40.0}, Interval{680.0, 720.0}};

/// Returns a rig whose lobes are 385 mm wide.
optics::Rig fine_rig() {
  return make_rig(
      {.width = 400, .height = 240, .pitch_subpx = 18.66, .slant = 0.141, .pixel_mm = 0.2});
}

struct Rendered {
  frames::WovenFrame frame;
  RenderStatistics statistics;
};

Rendered rendered(const std::string& method, const SceneDescription& description,
                  const optics::OpticalModel& model, const RenderOptions& options) {
  const Stage stage = make_tiny_stage();
  const Scene scene(description, stage, {}, 1);
  Rendered out{frames::WovenFrame({model.rig().panel.width_px, model.rig().panel.height_px}), {}};
  out.statistics = make_method(method, model, options)->render(scene, stage, out.frame);
  EXPECT_TRUE(out.statistics.completed);
  return out;
}

Rendered with_zone(const std::string& method, const SceneDescription& description,
                   const optics::OpticalModel& model, RenderOptions options) {
  options.zone = kZone;
  return rendered(method, description, model, options);
}

/// Calls visit(code in a, code in b, seen) for each subpixel.
template <class Visit>
void for_each_subpixel(const optics::OpticalModel& model, const frames::WovenFrame& a,
                       const frames::WovenFrame& b, const Visit& visit) {
  const optics::ZoneVisibility visibility(model, kZone);
  optics::ZoneVisibility::Row row;
  for (int j = 0; j < a.height(); ++j) {
    visibility.evaluate(j, row);
    for (size_t s = 0; s < row.seen.size(); ++s) visit(a.row(j)[s], b.row(j)[s], row.seen[s] != 0);
  }
}

/// Returns the number of unseen subpixels after checking that they are black in `zone`, and that
/// all others have the bytes of `all`.
uint64_t expect_same_bytes(const optics::OpticalModel& model, const frames::WovenFrame& all,
                           const frames::WovenFrame& zone) {
  uint64_t unseen = 0, wrong = 0;
  for_each_subpixel(model, all, zone, [&](uint8_t before, uint8_t after, bool seen) {
    unseen += seen ? 0 : 1;
    wrong += after != (seen ? before : 0) ? 1 : 0;
  });
  EXPECT_EQ(wrong, 0U);
  return unseen;
}

TEST(ViewingZone, FullRendersTheSeenSubpixelsToTheSameBytes) {
  const optics::OpticalModel model(fine_rig());
  for (const testing::NamedScene& named : testing::tiny_scenes())
    for (const RenderOptions& options :
         {RenderOptions{.threads = 1, .cancelled = {}},
          RenderOptions{.threads = 3, .samples = 3, .cancelled = {}},
          RenderOptions{.prefilter = Prefilter::Beam, .prefilter_samples = 5, .cancelled = {}},
          RenderOptions{.soft = {.shadow_samples = 4}, .cancelled = {}}}) {
      SCOPED_TRACE(named.name);
      const Rendered all = rendered("full", named.scene, model, options);
      const Rendered zone = with_zone("full", named.scene, model, options);
      const uint64_t unseen = expect_same_bytes(model, all.frame, zone.frame);
      EXPECT_GT(unseen, all.statistics.subpixels / 4);
      EXPECT_EQ(zone.statistics.unseen_subpixels, unseen);
      EXPECT_EQ(zone.statistics.traced_subpixels, zone.statistics.subpixels - unseen);
    }
}

/// Most packets are skipped: those of which no lane is seen.
TEST(ViewingZone, FullTracesFewerRays) {
  const optics::OpticalModel model(fine_rig());
  const RenderOptions options{.skip_background = false, .cancelled = {}};
  const SceneDescription scene = testing::tiny_scenes().front().scene;
  const uint64_t all = rendered("full", scene, model, options).statistics.primary_rays;
  const RenderStatistics zone = with_zone("full", scene, model, options).statistics;
  EXPECT_LT(zone.primary_rays, all - zone.unseen_subpixels / 2);
}

TEST(ViewingZone, AdaptiveKeepsItsErrorOnTheSeenSubpixels) {
  const optics::OpticalModel model(fine_rig());
  RenderOptions proven;
  promise_psnr(40.0, proven);
  for (const testing::NamedScene& named : testing::tiny_scenes())
    for (const RenderOptions& options : {RenderOptions{.cancelled = {}}, proven}) {
      SCOPED_TRACE(named.name);
      const Rendered full = rendered("full", named.scene, model, {.cancelled = {}});
      const Rendered zone = with_zone("adaptive", named.scene, model, options);
      const RenderStatistics& s = zone.statistics;
      uint64_t seen_count = 0, beyond = 0, lit = 0;
      double squares = 0.0;
      for_each_subpixel(model, full.frame, zone.frame, [&](uint8_t exact, uint8_t code, bool seen) {
        lit += !seen && code != 0 ? 1 : 0;
        if (!seen) return;
        const int off = std::abs(int{exact} - int{code});
        ++seen_count;
        beyond += off > options.tolerated_error ? 1 : 0;
        squares += off * off;
      });
      const auto count = static_cast<double>(seen_count);
      EXPECT_EQ(lit, 0U);
      EXPECT_EQ(s.unseen_subpixels, s.subpixels - seen_count);
      EXPECT_EQ(s.traced_subpixels + s.interpolated_subpixels, seen_count);
      EXPECT_LE(static_cast<double>(beyond) / count, s.beyond_bound);
      EXPECT_LE(std::sqrt(squares / count), s.rmse_bound + 1e-12);
      if (options.proven_rmse > 0.0) {
        EXPECT_LE(s.rmse_bound, options.proven_rmse);
      }
    }
}

TEST(ViewingZone, AdaptiveGivesTheSameBytesForAnyThreads) {
  const optics::OpticalModel model(fine_rig());
  for (const testing::NamedScene& named : testing::tiny_scenes())
    EXPECT_EQ(with_zone("adaptive", named.scene, model, {.threads = 1, .cancelled = {}}).frame,
              with_zone("adaptive", named.scene, model,
                        {.threads = 3, .tiles_backwards = true, .cancelled = {}})
                  .frame)
        << named.name;
}

/// An unchanged frame is copied, and moving objects leave the unseen subpixels black.
TEST(ViewingZone, AdaptiveFramesOfAFilmHaveTheBytesOfSingleFrames) {
  const optics::OpticalModel model(fine_rig());
  const Stage stage = make_tiny_stage();
  SceneDescription description = testing::tiny_scenes().front().scene;
  const RenderOptions options{.zone = kZone, .cancelled = {}};
  RenderOptions film = options;
  film.copy_unchanged = true;
  const auto method = make_method("adaptive", model, film);
  for (int n = 0; n < 3; ++n) {
    if (n == 2) description = testing::moved(description, 1.0, {0.05, 0.0, 0.0});
    const Scene scene(description, stage, {}, 1);
    frames::WovenFrame frame({model.rig().panel.width_px, model.rig().panel.height_px});
    EXPECT_TRUE(method->render(scene, stage, frame).completed);
    EXPECT_EQ(frame, rendered("adaptive", description, model, options).frame) << n;
  }
}

TEST(ViewingZone, AnEyeInTheZoneSeesTheSamePicture) {
  const optics::OpticalModel model(fine_rig());
  const SceneDescription scene = testing::tiny_scenes().front().scene;
  const Rendered all = rendered("full", scene, model, {.cancelled = {}});
  const Rendered zone = with_zone("full", scene, model, {.cancelled = {}});
  const auto picture = [&](const frames::WovenFrame& frame, const optics::Eye& eye) {
    return optics::simulate_eye(model,
                                {frame.bytes().data(), frame.width(), frame.height(),
                                 frame.view().geometry.width * size_t{3}},
                                eye)
        .pixels;
  };
  for (const double x : {-60.0, -13.0, 40.0})
    for (const double z : {680.0, 700.0, 720.0})
      EXPECT_EQ(picture(all.frame, {x, 0.0, z}), picture(zone.frame, {x, 0.0, z}))
          << x << ", " << z;
  EXPECT_NE(picture(all.frame, {180.0, 0.0, 700.0}), picture(zone.frame, {180.0, 0.0, 700.0}));
}

TEST(ViewingZone, IsRefusedByMethodsThatReuseColours) {
  const optics::OpticalModel model(fine_rig());
  for (const char* method : {"lens-view", "interpolate", "temporal", "hybrid"})
    EXPECT_THROW((void)make_method(method, model, {.zone = kZone, .cancelled = {}}), Error)
        << method;
}

}  // namespace
}  // namespace lenticule::render
