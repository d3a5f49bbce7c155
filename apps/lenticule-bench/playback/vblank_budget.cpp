// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/playback/vblank_budget.h"

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "apps/lenticule-bench/harness/thread_clock.h"
#include "apps/lenticule-tools/offline/scratch_folder.h"
#include "base/error.h"
#include "base/print.h"
#include "display/scanout_format.h"
#include "frames/sequence/sequence_reader.h"
#include "frames/sequence/sequence_writer.h"
#include "frames/weaving/fast_weaver.h"
#include "frames/weaving/quilt_file.h"
#include "frames/weaving/reweave.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {
namespace {

constexpr double kVblankMs = 1e3 / 60.0;

/// StoredFrame is a frame in a container, which can be decoded repeatedly.
class StoredFrame {
 public:
  StoredFrame(const frames::WovenFrame& frame, const std::string& file)
      : decoded_(frame.geometry()) {
    frames::SequenceInfo info;
    info.geometry = frame.geometry();
    info.rate = {.numerator = 60, .denominator = 1};
    frames::SequenceWriter writer(file, info);
    writer.append(frame.view());
    writer.finish();
    reader_ = std::make_unique<frames::SequenceReader>(file);
    decoder_.emplace(reader_->make_decoder());
  }
  void decode() { LENTICULE_CHECK(decoder_->decode(0, decoded_.bytes())); }

 private:
  frames::WovenFrame decoded_;
  std::unique_ptr<frames::SequenceReader> reader_;
  std::optional<frames::FrameDecoder> decoder_;
};

void copy_to_scanout(const frames::WovenFrame& frame, std::vector<uint32_t>& scanout) {
  const auto width = static_cast<size_t>(frame.width());
  for (int j = 0; j < frame.height(); ++j)
    display::expand_row(display::ScanoutDepth::Bits8, frame.row(j),
                        scanout.data() + static_cast<size_t>(j) * width, width);
}

/// Milliseconds of each step, one per run.
struct StepTimes {
  std::vector<double> decode_woven, decode_views, weave, copy;
};

StepTimes time_steps(const BenchScene& scene, const frames::ViewSet& views, int runs) {
  const tools::ScratchFolder folder;
  StoredFrame woven(scene.frame(), folder.file("woven.lts"));
  StoredFrame quilt(frames::draw_quilt(views, frames::quilt_layout_for(views)),
                    folder.file("views.lts"));
  frames::FastWeaver weaver(std::make_shared<const frames::WeavePlan>(
                                scene.model(), frames::shape_of(views), frames::WeaveOptions{}),
                            1);
  frames::WovenFrame frame(scene.frame().geometry());
  std::vector<uint32_t> scanout(frame.bytes().size() / 3);
  const auto milliseconds = [](auto&& work) { return 1e3 * thread_seconds(work); };
  StepTimes times;
  for (int run = 0; run < runs && !player::interrupted(); ++run) {
    times.decode_woven.push_back(milliseconds([&] { woven.decode(); }));
    times.decode_views.push_back(milliseconds([&] { quilt.decode(); }));
    times.weave.push_back(milliseconds([&] { weaver.weave(views, frame); }));
    times.copy.push_back(milliseconds([&] { copy_to_scanout(frame, scanout); }));
  }
  return times;
}

nlohmann::json row(const std::string& source, std::optional<double> decode,
                   std::optional<double> weave, double copy) {
  const auto or_null = [](std::optional<double> ms) {
    return ms ? nlohmann::json(*ms) : nlohmann::json();
  };
  const double total = decode.value_or(0.0) + weave.value_or(0.0) + copy;
  return {{"source", source},           {"decode_ms", or_null(decode)},
          {"weave_ms", or_null(weave)}, {"copy_ms", copy},
          {"total_ms", total},          {"part_of_vblank", total / kVblankMs}};
}

}  // namespace

nlohmann::json measure_vblank_budget(const optics::Rig& rig, int runs) {
  BenchScene scene({.scene = bench_scene_name("demo"), .rig = rig});
  static_cast<void>(scene.render(*scene.method(scene.options(render::RenderOptions{}.max_depth))));
  if (player::interrupted()) return nlohmann::json::array();
  const frames::ViewSet views = frames::views_of_woven(scene.frame().view(), scene.model(),
                                                       frames::views_in_woven(scene.model().rig()));
  const StepTimes times = time_steps(scene, views, runs);
  const double copy = median(times.copy), weave = median(times.weave);
  const std::string shape =
      fmt::format("{} views of {}x{}", views.count(), views.width(), views.height());
  return {row("woven sequence", median(times.decode_woven), std::nullopt, copy),
          row("sequence of " + shape, median(times.decode_views), weave, copy),
          row("decoded quilts, " + shape, std::nullopt, weave, copy),
          row("ring", std::nullopt, std::nullopt, copy)};
}

void print_vblank_budget(const nlohmann::json& rows) {
  print_out("\none core's time per frame, and its share of a vblank at 60 Hz\n");
  print_out("{:<36} {:>9} {:>9} {:>9} {:>9} {:>9}\n", "", "decode ms", "weave ms", "copy ms",
            "total ms", "of vblank");
  const auto cell = [](const nlohmann::json& value) {
    return value.is_null() ? std::string("-") : fmt::format("{:.2f}", value.get<double>());
  };
  for (const nlohmann::json& row : rows)
    print_out("{:<36} {:>9} {:>9} {:>9} {:>9} {:>8.0f}%\n", row["source"].get<std::string>(),
              cell(row["decode_ms"]), cell(row["weave_ms"]), cell(row["copy_ms"]),
              cell(row["total_ms"]), 100.0 * row["part_of_vblank"].get<double>());
}

}  // namespace lenticule::bench
