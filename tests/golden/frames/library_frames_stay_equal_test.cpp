// SPDX-License-Identifier: Apache-2.0
// Frames that the libraries render, weave, convert from video and send to a panel have the bytes
// that are committed in hashes/, with every kernel of this machine. Starts no other program, so
// that it also runs where another processor is emulated.
#include <cstdlib>

#include "apps/lenticule-video/pixel_convert.h"
#include "display/scanout_format.h"
#include "frames/weaving/crosstalk.h"
#include "frames/weaving/fast_weaver.h"
#include "render/methods/method.h"
#include "tests/golden/frames/golden_hashes.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/noise_frame.h"
#include "tests/support/tiny_scenes.h"
#include "tests/support/turned_picture.h"
#include "tests/support/weave_rigs.h"

namespace lenticule::test {
namespace {

using frames::ViewSet;
using frames::WovenFrame;
using optics::SubpixelLayout;

/// Records the hash under `name`; a kernel that makes other bytes than an earlier one fails.
void note(Hashes& hashes, const std::string& name, const std::string& hash,
          const std::string& kernel) {
  const auto [at, is_new] = hashes.emplace(name, hash);
  if (!is_new) {
    EXPECT_EQ(at->second, hash) << name << " by " << kernel;
  }
}

/// Textured and metallic, beside materials that are converted.
NamedScene metallic_scene() {
  std::vector<NamedScene> scenes = tiny_scenes();
  NamedScene out = *std::ranges::find(scenes, "meshes", &NamedScene::name);
  out.name = "metallic";
  out.scene.materials[1].pbr = std::make_shared<render::PbrMaterial>(render::PbrMaterial{
      .base_colour_texture = {.texture = 0}, .metallic = 0.7, .roughness = 0.3});
  return out;
}

TEST(LibraryFramesStayEqual, OfEveryMethodInstructionSetAndNumberOfThreads) {
  ASSERT_EQ(setenv("LENTICULE_EMBREE_ISA", "sse2", 1), 0);
  const optics::OpticalModel model(make_rig({.width = 96, .height = 64, .pixel_mm = 0.6}));
  std::vector<NamedScene> scenes = tiny_scenes();
  scenes.push_back(metallic_scene());
  Hashes hashes;
  WovenFrame frame({.width = 96, .height = 64});
  for (const NamedScene& named : scenes)
    for (const std::string& name : render::method_names())
      for (const Isa isa : every_instruction_set())
        for (const int threads : {1, 3}) {
          if (!isa_supported(isa)) continue;
          const auto method =
              render::make_method(name, model, {.threads = threads, .isa = isa, .cancelled = {}});
          for (int n = 0; n < 2; ++n) {
            const render::Stage stage =
                make_tiny_stage({.mm_per_unit = 7.0, .turn_degrees = 0.4 * n});
            const render::Scene scene(named.scene, stage, {}, threads);
            ASSERT_TRUE(method->render(scene, stage, frame).completed);
            note(hashes, fmt::format("{} {} {}", named.name, name, n),
                 hash_of_rendered(frame.bytes()),
                 fmt::format("{}, {} threads", isa_name(isa), threads));
          }
        }
  expect_committed("rendered", hashes);
}

void weave_by_all(Hashes& hashes, const std::string& name, const optics::Rig& rig,
                  const ViewSet& views, const frames::WeaveOptions& options) {
  const auto plan = std::make_shared<const frames::WeavePlan>(optics::OpticalModel(rig),
                                                              frames::shape_of(views), options);
  for (const frames::WeaveKernel kernel : frames::kWeaveKernels) {
    if (!frames::kernel_suits(kernel, *plan)) continue;
    WovenFrame frame(plan->geometry());
    frames::FastWeaver(plan, 1, kernel).weave(views, frame);
    note(hashes, name, hash_of(frame.bytes()), to_string(kernel));
  }
}

TEST(LibraryFramesStayEqual, OfEveryQuiltFilterAndRig) {
  Hashes hashes;
  int number = 0;
  for (const WeaveSetting& setting : weave_settings()) {
    const ViewSet views(setting.noise(), setting.layout);
    if (views.count() > 64) continue;  // only the reference weaves these
    for (const auto& [layout, name] :
         {std::pair{SubpixelLayout::rgb(), "rgb"}, std::pair{SubpixelLayout::bgr(), "bgr"},
          std::pair{two_over_one(), "cells"}})
      for (const int width : {70, 1600})
        weave_by_all(hashes, fmt::format("setting {} {} {}", number, name, width),
                     weave_rig(width, 9, 7.71, 0.2513, 300.0, layout), views, setting.options);
    ++number;
  }
  const ViewSet views(weave_noise(36, 40, 5), {.columns = 4, .rows = 2});
  for (const double percent : {5.0, 30.0})
    weave_by_all(hashes, fmt::format("crosstalk {}", percent),
                 weave_rig(200, 9, 24.04, -1.0, 700.0),
                 frames::compensate(views, frames::crosstalk_of_percent(percent)),
                 {.filter = frames::ViewFilter::Linear});
  expect_committed("woven", hashes);
}

/// Returns a layout of planes with `depth` bits per sample.
video::PixelLayout planar(video::ColourModel model, int depth, int shift_x, int shift_y,
                          bool full_range) {
  video::PixelLayout layout{.model = model,
                            .components = {},
                            .chroma_shift_x = shift_x,
                            .chroma_shift_y = shift_y,
                            .full_range = full_range};
  for (int c = 0; c < 3; ++c)
    layout.components.at(static_cast<size_t>(c)) = {
        .plane = c, .step = depth > 8 ? 2 : 1, .offset = 0, .shift = 0, .depth = depth};
  return layout;
}

TEST(LibraryFramesStayEqual, OfEveryPixelFormatOfVideo) {
  constexpr int kWidth = 67, kHeight = 21;
  Hashes hashes;
  const auto convert = [&](const std::string& name, const video::PixelLayout& layout) {
    const int depth = layout.components[0].depth, bytes = depth > 8 ? 2 : 1;
    std::array<std::vector<uint8_t>, 3> planes;
    video::PicturePlanes picture{.data = {}, .stride = {}, .width = kWidth, .height = kHeight};
    for (size_t c = 0; c < 3; ++c) {
      const bool sub = c > 0;
      const int width =
          sub ? (kWidth + (1 << layout.chroma_shift_x) - 1) >> layout.chroma_shift_x : kWidth;
      planes[c] = std::vector<uint8_t>(static_cast<size_t>(width * kHeight * bytes));
      uint32_t random = 7 + static_cast<uint32_t>(c);
      for (size_t n = 0; n < planes[c].size(); n += static_cast<size_t>(bytes)) {
        random = random * 1664525U + 1013904223U;
        const uint32_t value = (random >> 8) & ((1U << depth) - 1);
        planes[c][n] = static_cast<uint8_t>(value);
        if (bytes == 2) planes[c][n + 1] = static_cast<uint8_t>(value >> 8);
      }
      picture.data.at(c) = planes[c].data();
      picture.stride.at(c) = width * bytes;
    }
    std::vector<uint8_t> rgb(3 * kWidth * kHeight);
    for (const Isa isa : every_instruction_set()) {
      video::PixelConverter(layout, kWidth, kHeight, isa).convert(picture, rgb);
      note(hashes, name, hash_of(rgb), isa_name(isa));
    }
  };
  for (const int depth : {8, 10, 12, 16}) {
    convert(fmt::format("rgb {}", depth), planar(video::ColourModel::Rgb, depth, 0, 0, true));
    for (const bool full : {false, true}) {
      const char* const range = full ? "full" : "limited";
      convert(fmt::format("grey {} {}", depth, range),
              planar(video::ColourModel::Grey, depth, 0, 0, full));
      for (const auto& [x, y, chroma] : {std::tuple{0, 0, "444"}, std::tuple{1, 0, "422"},
                                         std::tuple{1, 1, "420"}, std::tuple{2, 0, "411"}}) {
        video::PixelLayout layout = planar(video::ColourModel::Yuv, depth, x, y, full);
        convert(fmt::format("yuv {} {} {}", chroma, depth, range), layout);
        layout.kr = 0.299;
        layout.kb = 0.114;
        layout.site = {.across = 1, .down = 0};
        convert(fmt::format("yuv {} {} {} bt601, other site", chroma, depth, range), layout);
      }
    }
  }
  expect_committed("pixels", hashes);
}

TEST(LibraryFramesStayEqual, OfEveryMountingAndDepthOfScanOut) {
  Hashes hashes;
  const WovenFrame frame = noise_frame(203, 137, 5);
  for (const char* name : kMountingNames)
    for (const auto depth : {display::ScanoutDepth::Bits8, display::ScanoutDepth::Bits10})
      for (const Isa isa : every_instruction_set()) {
        const WovenFrame seen = seen_of(frame, name);
        std::vector<uint32_t> words(208 * 137);
        display::expand_frame(depth, seen.view(), optics::mounting_named(name), words.data(), 208,
                              isa);
        note(hashes, fmt::format("mounting {} {} bits", name, bits_of(depth)),
             hash_of({reinterpret_cast<const uint8_t*>(words.data()), 4 * words.size()}),
             isa_name(isa));
      }
  expect_committed("scanout", hashes);
}

}  // namespace
}  // namespace lenticule::test
