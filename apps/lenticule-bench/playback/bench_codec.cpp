// SPDX-License-Identifier: Apache-2.0
// lenticule bench codec measures the size of frames in a container and the decoding speed, compared
// with other codecs.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "base/error.h"
#include "base/print.h"
#include "frames/image_io.h"
#include "lab/fixtures.h"
#include "lab/judges/codec_trial.h"
#include "player/process/child_process.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {
namespace {

using lab::TrialKind;

using lab::ScratchFolder;

/// The baseline of all ratios.
constexpr const char* kBaseline = "row above, zstd -1";
constexpr const char* kContainer = "container";
constexpr std::chrono::seconds kFfmpegLimit{120};

struct CodecFlags : RunFlags {
  std::vector<std::string> scenes = {"demo", "balls", "gears", "tree"};
  std::vector<std::string> pictures;
  bool quick = false;
};

/// Candidate is a way to store a frame.
class Candidate {
 public:
  explicit Candidate(std::string name) : name_(std::move(name)) {}
  virtual ~Candidate() = default;
  [[nodiscard]] const std::string& name() const { return name_; }
  virtual uint64_t encode(const frames::WovenFrame& frame) = 0;
  virtual void decode(frames::WovenFrame& to) = 0;
  /// Returns the clock: processor time of this thread, which other programs disturb least, if all
  /// work is done in this thread.
  [[nodiscard]] virtual clockid_t clock() const { return CLOCK_THREAD_CPUTIME_ID; }
  /// Returns by how many code values a decoded subpixel may be off.
  [[nodiscard]] virtual int max_error() const { return 0; }

 private:
  std::string name_;
};

class InMemory final : public Candidate {
 public:
  /// `level` as in lab::CodecTrial: the largest error of a container.
  InMemory(std::string name, TrialKind kind, int level = 0)
      : Candidate(std::move(name)),
        max_error_(kind == TrialKind::Container ? level : 0),
        trial_(kind, level) {}
  uint64_t encode(const frames::WovenFrame& frame) override { return trial_.encode(frame.view()); }
  void decode(frames::WovenFrame& to) override {
    if (!trial_.decode(to)) throw Error(ErrorKind::Failed, name() + ": does not decode");
  }

  [[nodiscard]] int max_error() const override { return max_error_; }

 private:
  int max_error_;
  lab::CodecTrial trial_;
};

class PngFile final : public Candidate {
 public:
  explicit PngFile(const ScratchFolder& folder)
      : Candidate("PNG file"), file_(folder.file("frame.png")) {}
  uint64_t encode(const frames::WovenFrame& frame) override {
    frames::write_woven(frame.view(), file_);
    return std::filesystem::file_size(file_);
  }
  void decode(frames::WovenFrame& to) override { frames::read_woven_into(file_, to); }

 private:
  std::string file_;
};

/// Ffv1File uses the ffmpeg program on one thread; its start time is included.
class Ffv1File final : public Candidate {
 public:
  Ffv1File(std::string program, const ScratchFolder& folder)
      : Candidate("FFV1 by ffmpeg"),
        program_(std::move(program)),
        picture_(folder.file("in.ppm")),
        film_(folder.file("frame.mkv")),
        raw_(folder.file("out.rgb")) {}
  uint64_t encode(const frames::WovenFrame& frame) override {
    frames::write_woven(frame.view(), picture_);
    run({program_, "-y", "-v", "error", "-threads", "1", "-i", picture_, "-c:v", "ffv1", "-level",
         "3", "-pix_fmt", "gbrp", film_});
    return std::filesystem::file_size(film_);
  }
  void decode(frames::WovenFrame& to) override {
    run({program_, "-y", "-v", "error", "-threads", "1", "-i", film_, "-f", "rawvideo", "-pix_fmt",
         "rgb24", raw_});
    std::ifstream(raw_, std::ios::binary)
        .read(reinterpret_cast<char*>(to.bytes().data()),
              static_cast<std::streamsize>(to.bytes().size()));
  }
  [[nodiscard]] clockid_t clock() const override { return CLOCK_MONOTONIC; }

 private:
  static void run(const std::vector<std::string>& arguments) {
    const ProgramRun result = player::run_child(arguments, kFfmpegLimit);
    if (result.exit_code != 0) throw Error(ErrorKind::Failed, "ffmpeg: " + result.output);
  }

  std::string program_;
  std::string picture_;
  std::string film_;
  std::string raw_;
};

std::vector<std::unique_ptr<Candidate>> make_candidates(const ScratchFolder& folder) {
  std::vector<std::unique_ptr<Candidate>> list;
  const auto in_memory = [&](const char* name, TrialKind kind, int level = 0) {
    list.push_back(std::make_unique<InMemory>(name, kind, level));
  };
  in_memory("memcpy", TrialKind::Copy);
  in_memory(kContainer, TrialKind::Container);
  in_memory("container, error 1", TrialKind::Container, 1);
  in_memory("container, error 2", TrialKind::Container, 2);
  in_memory("container, error 4", TrialKind::Container, 4);
  in_memory(kBaseline, TrialKind::RowAbove, -1);
  in_memory("row above, zstd 1", TrialKind::RowAbove, 1);
  in_memory("zstd -5", TrialKind::Zstd, -5);
  in_memory("zstd -1", TrialKind::Zstd, -1);
  in_memory("zstd 3", TrialKind::Zstd, 3);
  list.push_back(std::make_unique<PngFile>(folder));
  if (const auto ffmpeg = player::find_program("ffmpeg"))
    list.push_back(std::make_unique<Ffv1File>(*ffmpeg, folder));
  return list;
}

struct Measured {
  std::string name;
  uint64_t bytes = 0;
  std::vector<double> encode;
  std::vector<double> decode;
};

int largest_difference(const frames::WovenFrame& a, const frames::WovenFrame& b) {
  int largest = 0;
  for (size_t at = 0; at < a.bytes().size(); ++at)
    largest = std::max(largest, std::abs(a.bytes()[at] - b.bytes()[at]));
  return largest;
}

/// Runs every candidate once per round, so that other load on the machine affects all of them. Slow
/// candidates stop after the second round.
std::vector<Measured> measure(const std::vector<std::unique_ptr<Candidate>>& candidates,
                              const frames::WovenFrame& frame, int runs) {
  constexpr double kSlow = 0.5;
  std::vector<Measured> all(candidates.size());
  frames::WovenFrame decoded(frame.geometry());
  for (int round = 0; round < runs && !player::interrupted(); ++round) {
    for (size_t i = 0; i < candidates.size(); ++i) {
      Measured& m = all[i];
      if (round >= 2 && median(m.encode) + median(m.decode) > kSlow) continue;
      m.name = candidates[i]->name();
      m.encode.push_back(
          seconds_by(candidates[i]->clock(), [&] { m.bytes = candidates[i]->encode(frame); }));
      m.decode.push_back(
          seconds_by(candidates[i]->clock(), [&] { candidates[i]->decode(decoded); }));
      if (largest_difference(decoded, frame) > candidates[i]->max_error())
        throw Error(ErrorKind::Failed, m.name + ": decodes to another frame");
    }
  }
  return all;
}

nlohmann::json frame_json(const std::string& name, const frames::WovenFrame& frame,
                          const std::vector<Measured>& all) {
  const auto base =
      std::find_if(all.begin(), all.end(), [](const Measured& m) { return m.name == kBaseline; });
  nlohmann::json rows = nlohmann::json::array();
  for (const Measured& m : all) {
    if (m.decode.empty()) continue;
    rows.push_back(
        {{"codec", m.name},
         {"bytes", m.bytes},
         {"encode_ms", 1e3 * median(m.encode)},
         {"decode_ms", 1e3 * median(m.decode)},
         {"size_to_baseline", static_cast<double>(m.bytes) / static_cast<double>(base->bytes)},
         {"decode_to_baseline", median(m.decode) / median(base->decode)}});
  }
  return {{"frame", name}, {"width", frame.width()}, {"height", frame.height()}, {"codecs", rows}};
}

void print_frame(const nlohmann::json& frame) {
  print_out("\n{} ({} x {})\n", frame["frame"].get<std::string>(), frame["width"].get<int>(),
            frame["height"].get<int>());
  constexpr Column kColumns[] = {{"", "codec"},
                                 {"MB", "bytes", "{:.2f}", 1e-6},
                                 {"encode ms", "encode_ms", "{:.1f}"},
                                 {"decode ms", "decode_ms", "{:.1f}"},
                                 {"size", "size_to_baseline", "{:.2f}"},
                                 {"decode", "decode_to_baseline", "{:.2f}"}};
  print_table(frame["codecs"], kColumns);
}

/// Returns a quarter of the panel: same pixels per lens, a quarter of the time.
optics::Rig quick_rig(optics::Rig rig) {
  rig.panel.width_px /= 2;
  rig.panel.height_px /= 2;
  return rig;
}

frames::WovenFrame render_scene(const std::string& scene, const optics::Rig& rig) {
  BenchScene bench({.scene = bench_scene_name(scene), .rig = rig});
  static_cast<void>(bench.render(*bench.method(bench.options(render::RenderOptions{}.max_depth))));
  return bench.frame();
}

ExitCode run(const CodecFlags& flags) {
  const ScratchFolder folder;
  const optics::Rig rig =
      flags.quick ? quick_rig(lab::bench_rig(flags.rig)) : lab::bench_rig(flags.rig);
  const std::vector<std::unique_ptr<Candidate>> candidates = make_candidates(folder);
  nlohmann::json frames = nlohmann::json::array();
  const auto take = [&](const std::string& name, const frames::WovenFrame& frame) {
    if (player::interrupted()) return;
    frames.push_back(frame_json(name, frame, measure(candidates, frame, flags.runs)));
    if (!flags.json) print_frame(frames.back());
  };
  if (!flags.json)
    print_out("{}\none thread, processor time; size and decode time relative to \"{}\"\n",
              machine_text(), kBaseline);
  for (const std::string& picture : flags.pictures) take(picture, frames::read_woven(picture));
  for (const std::string& scene : flags.scenes) {
    if (flags.pictures.empty() && !player::interrupted()) take(scene, render_scene(scene, rig));
  }
  if (flags.json)
    print_json({{"machine", machine_json()},
                {"baseline", kBaseline},
                {"runs", flags.runs},
                {"frames", frames}});
  return player::interrupt_exit_code();
}

}  // namespace

cli::Run declare_bench_codec(CLI::App& app) {
  auto flags = std::make_shared<CodecFlags>();
  app.add_option("--scene", flags->scenes, "built-in scenes of which a frame is rendered")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--picture", flags->pictures, "woven frames in files to use instead of scenes");
  flags->runs = 7;
  declare_run_flags(app, *flags);
  app.add_flag("--quick", flags->quick, "use a quarter of the panel");
  return [flags]() -> ExitCode { return run(*flags); };
}

}  // namespace lenticule::bench
