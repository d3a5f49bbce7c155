// SPDX-License-Identifier: Apache-2.0
// lenticule bench video measures how fast woven frames are decoded from video files, compared with
// PNG files of the same frames in the same run.
#include <fmt/format.h>
#include <poll.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <thread>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "apps/lenticule-tools/offline/video_writer.h"
#include "base/error.h"
#include "base/print.h"
#include "frames/decoded_source.h"
#include "frames/image_io.h"
#include "lab/fixtures.h"
#include "player/process/interrupt.h"
#include "player/sources/video_source.h"

namespace lenticule::bench {
namespace {

using tools::VideoCodec;

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr int kPool = 8;
/// More than the pool: with fewer, no frame would be decoded again.
constexpr int kLeastFrames = 10;
constexpr uint64_t kWarmUp = 12;  ///< more than any pool holds when the measurement begins
constexpr auto kTimeout = 120s;   ///< timeout for one frame

struct VideoFlags : RunFlags {
  int frames = 16;
  bool quick = false;
};

/// A way to store the frames.
struct Way {
  std::string name;
  double megabytes_per_frame = 0.0;
  double written_per_s = 0.0;
  std::function<std::unique_ptr<frames::FrameSource>()> open;
  std::vector<double> rates;
};

/// Returns a frame of eight views with moving shades side by side and a little noise: neighbours
/// differ as in woven pictures, and no row repeats another.
frames::WovenFrame woven_like(frames::FrameGeometry geometry, int k) {
  frames::WovenFrame frame(geometry);
  uint32_t noise = 1;
  for (int j = 0; j < geometry.height; ++j) {
    uint8_t* const row = frame.row(j);
    for (int s = 0; s < geometry.width * 3; ++s) {
      const int view = (s + j / 3) % 8;
      noise = noise * 1664525u + 1013904223u;
      row[s] = static_cast<uint8_t>((s / 24 + j / 8 + 23 * view + 2 * k) % 224 + (noise >> 29));
    }
  }
  return frame;
}

Way store_video(const VideoFlags& flags, frames::FrameGeometry geometry, VideoCodec codec,
                const std::string& file) {
  Way way{.name = codec == VideoCodec::Ffv1 ? "ffv1" : "x264rgb", .open = nullptr, .rates = {}};
  double seconds = 0.0;
  tools::VideoWriter writer({.file = file, .geometry = geometry, .rate = {60, 1}, .codec = codec});
  for (int k = 0; k < flags.frames; ++k) {
    const frames::WovenFrame frame = woven_like(geometry, k);
    seconds += seconds_by(CLOCK_MONOTONIC, [&] { writer.write(frame.view()); });
  }
  seconds += seconds_by(CLOCK_MONOTONIC, [&] { writer.finish(); });
  way.written_per_s = flags.frames / seconds;
  way.megabytes_per_frame =
      static_cast<double>(std::filesystem::file_size(file)) / 1e6 / flags.frames;
  way.open = [file] {
    return player::open_video({.file = file, .slots = kPool, .plays_again = true});
  };
  return way;
}

Way store_pngs(const VideoFlags& flags, frames::FrameGeometry geometry,
               const lab::ScratchFolder& folder) {
  Way way{.name = "png", .open = nullptr, .rates = {}};
  std::vector<std::filesystem::path> files;
  double seconds = 0.0;
  double bytes = 0.0;
  for (int k = 0; k < flags.frames; ++k) {
    files.emplace_back(folder.file(fmt::format("{:05}.png", k)));
    const frames::WovenFrame frame = woven_like(geometry, k);
    seconds +=
        seconds_by(CLOCK_MONOTONIC, [&] { frames::write_woven(frame.view(), files.back()); });
    bytes += static_cast<double>(std::filesystem::file_size(files.back()));
  }
  way.written_per_s = flags.frames / seconds;
  way.megabytes_per_frame = bytes / 1e6 / flags.frames;
  way.open = [files] {
    const int cores = static_cast<int>(std::thread::hardware_concurrency());
    return std::make_unique<frames::ImageSequence>(
        files,
        frames::ImageSequenceOptions{.pool_frames = kPool, .decoder_threads = std::max(cores, 1)});
  };
  return way;
}

void pull_frames(frames::FrameSource& source, uint64_t count) {
  Clock::time_point deadline = Clock::now() + kTimeout;
  for (uint64_t done = 0; done < count && !player::interrupted();) {
    frames::AcquiredFrame acquired;
    switch (source.pull(acquired)) {
      case frames::PullStatus::Ready:
        source.release(acquired.token);
        ++done;
        deadline = Clock::now() + kTimeout;
        continue;
      case frames::PullStatus::End:
        if (source.rewind()) continue;
        break;
      case frames::PullStatus::NotYet: {
        pollfd wake{.fd = source.wake_fd(), .events = POLLIN, .revents = 0};
        (void)poll(&wake, 1, 50);
        source.service();
        if (Clock::now() < deadline) continue;
        break;
      }
      case frames::PullStatus::Failed:
        break;
    }
    throw Error(ErrorKind::Failed, "bench video: no frame arrives: " + source.failure());
  }
}

double frames_per_second(const Way& way, int frames) {
  const auto source = way.open();
  pull_frames(*source, kWarmUp);
  return frames /
         seconds_by(CLOCK_MONOTONIC, [&] { pull_frames(*source, static_cast<uint64_t>(frames)); });
}

void print_ways(const nlohmann::json& report) {
  print_out("machine   {}\nframes    {}x{}\n\n", machine_text(), report["width"].get<int>(),
            report["height"].get<int>());
  constexpr Column kColumns[] = {{"stored", "name"},
                                 {"MB/frame", "megabytes_per_frame", "{:.1f}"},
                                 {"written/s", "written_per_s", "{:.1f}"},
                                 {"decoded/s", "decoded_per_s", "{:.1f}"},
                                 {"x png", "times_png", "{:.2f}"}};
  print_table(report["rows"], kColumns);
}

ExitCode run_video(const VideoFlags& given) {
  VideoFlags flags = given;
  if (flags.quick) {
    flags.frames = kLeastFrames;
    flags.runs = 1;
  }
  const optics::Rig rig = lab::bench_rig(flags.rig);
  const frames::FrameGeometry geometry{.width = rig.panel.width_px, .height = rig.panel.height_px};
  const lab::ScratchFolder folder;
  std::vector<Way> ways;
  ways.push_back(store_pngs(flags, geometry, folder));
  ways.push_back(store_video(flags, geometry, VideoCodec::Ffv1, folder.file("ffv1.mkv")));
  ways.push_back(store_video(flags, geometry, VideoCodec::X264Rgb, folder.file("x264rgb.mkv")));
  // Interleaved runs, so that other load on the machine affects all equally.
  for (int run = 0; run < flags.runs && !player::interrupted(); ++run)
    for (Way& way : ways) way.rates.push_back(frames_per_second(way, flags.frames));
  if (player::interrupted()) return player::interrupt_exit_code();
  nlohmann::json rows = nlohmann::json::array();
  for (const Way& way : ways)
    rows.push_back({{"name", way.name},
                    {"megabytes_per_frame", way.megabytes_per_frame},
                    {"written_per_s", way.written_per_s},
                    {"decoded_per_s", median(way.rates)},
                    {"times_png", median(way.rates) / median(ways.front().rates)}});
  const nlohmann::json report = {{"machine", machine_json()},
                                 {"width", geometry.width},
                                 {"height", geometry.height},
                                 {"rows", rows}};
  if (flags.json)
    print_json(report);
  else
    print_ways(report);
  return kOk;
}

}  // namespace

cli::Run declare_bench_video(CLI::App& app) {
  const auto flags = std::make_shared<VideoFlags>();
  flags->runs = 3;
  declare_run_flags(app, *flags);
  app.add_option("--frames", flags->frames, "number of frames of the clip")
      ->check(CLI::Range(kLeastFrames, 10000))
      ->capture_default_str();
  app.add_flag("--quick", flags->quick, "use few frames, as a functional check only");
  return [flags] { return run_video(*flags); };
}

}  // namespace lenticule::bench
