// SPDX-License-Identifier: Apache-2.0
// lenticule farm render renders one chunk of a plan. It may be called any number of times, also at
// the same time on several machines, and be killed at any moment: a chunk appears in the work
// folder as a whole or not at all. lenticule farm feed passes the frames to a player while they are
// made, and farm merge joins the chunks.
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <optional>
#include <thread>

#include "apps/lenticule-tools/farm/actions.h"
#include "apps/lenticule-tools/offline/frame_output.h"
#include "base/cpu.h"
#include "base/error_kinds.h"
#include "base/file.h"
#include "base/json_output.h"
#include "base/print.h"
#include "base/temporary.h"
#include "base/text.h"
#include "farm/sequence_joiner.h"
#include "farm/work_folder.h"
#include "frames/sequence/band_codec.h"
#include "frames/sequence/sequence_reader.h"
#include "frames/sequence/sequence_writer.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "player/sources/source_spec.h"

namespace lenticule::tools {

namespace {

using Clock = std::chrono::steady_clock;
namespace fs = std::filesystem;

/// Returns the name of the node as its scheduler has it, else as the network has it.
std::string node_name() {
  if (const char* name = std::getenv("SLURMD_NODENAME")) return name;
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "unknown";
}

/// Heartbeat writes the progress file regularly, also during a frame that takes hours. A failed
/// write only makes the status out of date.
class Heartbeat {
 public:
  Heartbeat(fs::path file, farm::ChunkProgress progress)
      : file_(std::move(file)),
        progress_(std::move(progress)),
        thread_([this](const std::stop_token& stop) { run(stop); }) {}

  void frame_done() {
    const std::lock_guard lock(mutex_);
    ++progress_.done;
  }

 private:
  void run(const std::stop_token& stop) {
    constexpr std::chrono::seconds kFirst{2};
    constexpr std::chrono::seconds kPause{20};
    bool first = true;
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
      progress_.seconds = seconds_since(begin_);
      const std::string text = farm::record_to_json(progress_);
      lock.unlock();
      try {
        write_text_file(file_, text);
      } catch (const std::exception&) {  // a full disk: the frames report it
      }
      lock.lock();
      ended_.wait_for(lock, stop, first ? kFirst : kPause, [] { return false; });
      first = false;
    }
  }

  fs::path file_;
  farm::ChunkProgress progress_;
  Clock::time_point begin_ = Clock::now();
  std::mutex mutex_;
  std::condition_variable_any ended_;
  std::jthread thread_;  // last member: the thread uses everything above
};

class ChunkRun {
 public:
  ChunkRun(const farm::WorkFolder& folder, const FarmFlags& flags)
      : folder_(folder), flags_(flags), chunk_(folder.plan().chunk(flags.chunk)) {
    report_.plan = folder.identity();
    report_.chunk = chunk_.number;
    report_.begin = chunk_.begin;
    report_.end = chunk_.end;
    report_.node = node_name();
    report_.isa = isa_name(best_isa());
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    report_.started = std::chrono::duration<double>(now).count();
  }

  ExitCode run() {
    if (folder_.done(chunk_.number)) {
      say("chunk {}: already done\n", chunk_.number);
      remove_leftovers();
      return kOk;
    }
    try {
      const ExitCode code = render();
      if (code != kOk) return code;
    } catch (const Error& error) {
      // The other process has removed the attempts of this chunk, this one among them.
      if (folder_.done(chunk_.number)) return kOk;
      note_failure(error);
      throw;
    }
    remove_leftovers();
    if (agrees_) return kOk;
    const auto first = folder_.report(chunk_.number);
    throw quality_error("chunk {}: {} has rendered other bytes than {}, whose result stays",
                        chunk_.number, report_.node, first ? first->node : "another node")
        .remedy(fmt::format("find the node that is wrong: lenticule farm verify {}",
                            shell_quoted(folder_.path().string())));
  }

 private:
  ExitCode render() {
    farm::create_folders(folder_.attempts_folder(chunk_.number));
    const TemporaryFolder attempt(folder_.attempts_folder(chunk_.number));
    Heartbeat heartbeat(attempt.path() / "progress.json",
                        {.node = report_.node, .chunk = chunk_.number, .count = chunk_.count()});
    PlannedFilm film(folder_.plan(), flags_.threads);
    film.require_inputs_of(chunk_);
    report_.threads = film.threads();
    const fs::path file = attempt.path() / "chunk.lts";
    if (!render_to(film.renderer(), attempt.path(), file, heartbeat))
      return player::interrupt_exit_code();
    report_.digest = farm::digest_of_file(file);
    report_.bytes = open_regular_file(file, UINT64_MAX).bytes;
    report_.seconds = seconds_since(begin_);
    agrees_ = folder_.finish_chunk(attempt.path(), file, report_);
    if (flags_.json) print_json(result());
    return kOk;
  }

  /// Returns false if interrupted.
  bool render_to(FilmRenderer& renderer, const fs::path& attempt, const fs::path& file,
                 Heartbeat& heartbeat) {
    frames::WovenFrame frame(renderer.geometry());
    last_frame_seconds_ = seconds_since(begin_);
    const auto part = place_in_film(renderer, attempt, frame);
    if (!part) return false;
    frames::SequenceInfo info = folder_.plan().film;
    info.first_frame = chunk_.begin;
    frames::SequenceWriter writer(file, info, {.threads = flags_.threads, .part_of_film = *part});
    player::Progress progress(fmt::format("chunk {}", chunk_.number), "frames", chunk_.count());
    for (uint64_t number = chunk_.begin; number < chunk_.end; ++number) {
      if (!render_frame(renderer, number, frame)) return false;
      writer.append(frame.view());
      if (number == chunk_.begin) report_.first_bands = farm::band_digests(frame.view());
      if (number + 1 == chunk_.end) report_.last_bands = farm::band_digests(frame.view());
      publish_own_predictors(number, attempt, frame);
      heartbeat.frame_done();
      progress.update(number - chunk_.begin + 1);
    }
    writer.finish();
    progress.finish();
    return true;
  }

  /// Renders a frame, and adds the time since the last frame to that of the chunk's own frames, or
  /// to that of frames which other chunks render, too.
  bool render_frame(FilmRenderer& renderer, uint64_t number, frames::WovenFrame& frame) {
    const auto count = [&](const render::RenderStatistics&, bool again) {
      const double now = seconds_since(begin_);
      const bool own = number >= chunk_.begin && !again;
      (own ? report_.render_seconds : report_.extra_seconds) += now - last_frame_seconds_;
      last_frame_seconds_ = now;
    };
    return renderer.render(number, frame, player::interrupted, count);
  }

  /// Returns the chunk's place in the film: its predictors come from an earlier frame, which
  /// another chunk may have rendered already. Returns none if interrupted.
  std::optional<frames::SequencePart> place_in_film(FilmRenderer& renderer, const fs::path& attempt,
                                                    frames::WovenFrame& frame) {
    const uint64_t first = chunk_.begin - folder_.plan().begin;
    frames::SequencePart part{.first = first};
    const uint64_t key = first - first % frames::kPredictorInterval;
    if (key == first) return part;
    if (const auto known = folder_.predictors(key)) {
      part.predictors = *known;
      return part;
    }
    if (!render_frame(renderer, folder_.plan().begin + key, frame)) return std::nullopt;
    part.predictors = predictors_of(frame);
    folder_.publish_predictors(key, part.predictors, attempt);
    return part;
  }

  static frames::PredictorTable predictors_of(const frames::WovenFrame& frame) {
    return frames::choose_predictors(frame.view(), frames::choose_band_rows(frame.geometry()));
  }

  /// Publishes the predictors that a frame of this chunk chooses, if later chunks need them.
  void publish_own_predictors(uint64_t number, const fs::path& attempt,
                              const frames::WovenFrame& frame) const {
    const uint64_t index = number - folder_.plan().begin;
    const uint64_t end = chunk_.end - folder_.plan().begin;
    if (index % frames::kPredictorInterval != 0 || chunk_.end == folder_.plan().end ||
        end - index >= frames::kPredictorInterval)
      return;
    folder_.publish_predictors(index, predictors_of(frame), attempt);
  }

  /// Removes the attempts of this chunk that were killed, and the record of an earlier failure. A
  /// process that still renders the chunk keeps its attempt, and removes the folder at its end.
  void remove_leftovers() const {
    std::error_code ignored;
    sweep_leftovers(folder_.attempts_folder(chunk_.number));
    fs::remove(folder_.attempts_folder(chunk_.number), ignored);
    fs::remove(folder_.failure_file(chunk_.number), ignored);
  }

  void note_failure(const Error& error) const {
    try {
      const TemporaryFolder attempt(folder_.attempts_folder(chunk_.number));
      const fs::path made = attempt.path() / "failure.json";
      write_text_file(made, farm::record_to_json(farm::ChunkFailure{.node = report_.node,
                                                                    .chunk = chunk_.number,
                                                                    .error = error.what(),
                                                                    .hint = error.hint()}));
      farm::move_file(made, folder_.failure_file(chunk_.number));
    } catch (const Error&) {  // a full disk: the chunk counts as missing
    }
  }

  [[nodiscard]] nlohmann::json result() const {
    return {{"chunk", chunk_.number},
            {"frames", {chunk_.begin, chunk_.end}},
            {"digest", report_.digest},
            {"bytes", report_.bytes},
            {"node", report_.node},
            {"seconds", report_.seconds},
            {"render_seconds", report_.render_seconds},
            {"extra_seconds", report_.extra_seconds},
            {"agrees", agrees_}};
  }

  const farm::WorkFolder& folder_;
  const FarmFlags& flags_;
  farm::Chunk chunk_;
  farm::ChunkReport report_;
  Clock::time_point begin_ = Clock::now();
  double last_frame_seconds_ = 0.0;
  bool agrees_ = true;  ///< no process has reported other bytes before
};

/// Waits for a chunk; returns none if interrupted.
std::optional<farm::ChunkReport> await_chunk(const farm::WorkFolder& folder, uint64_t chunk) {
  constexpr std::chrono::milliseconds kLook{250};
  do {
    if (auto report = folder.done(chunk)) return report;
  } while (player::wait_unless_interrupted(kLook));
  return std::nullopt;
}

/// Delivers the frames of a chunk; returns false if interrupted. Opens a file again that cannot be
/// read: a network file system takes an opened file away when another node renames one to its name.
bool deliver_chunk(const farm::WorkFolder& folder, const farm::ChunkReport& report,
                   FrameOutput& output, frames::WovenFrame& frame) {
  const std::filesystem::path file = folder.chunk_file(report);
  uint64_t next = report.begin;
  for (const bool again : {false, true}) {
    const frames::SequenceReader reader(file);
    if (reader.geometry() != frame.geometry() || reader.frame_count() != report.end - report.begin)
      throw input_error("{}: not the frames of the plan", file.string());
    frames::FrameDecoder decoder = reader.make_decoder();
    for (; next < report.end && decoder.decode(next - report.begin, frame.bytes()); ++next)
      if (!output.deliver(next, frame.view())) return false;
    if (next == report.end) return true;
    if (again) break;
  }
  throw input_error("{}: frame {} is damaged", file.string(), next)
      .remedy("lenticule farm merge names the command that renders the chunk again");
}

}  // namespace

ExitCode farm_render(const FarmFlags& flags) {
  const farm::WorkFolder folder(flags.folder);
  if (flags.chunk >= folder.plan().chunks())
    throw usage_error("chunk {}: the plan has chunks 0 to {}", flags.chunk,
                      folder.plan().chunks() - 1);
  return ChunkRun(folder, flags).run();
}

// lenticule farm feed passes frames to a player in their order while the farm renders: each frame
// once, as soon as its chunk and all chunks before it are done.

ExitCode farm_feed(const FarmFlags& flags) {
  const farm::WorkFolder folder(flags.folder);
  const farm::Plan& plan = folder.plan();
  if (player::parse_source(flags.output).kind != player::SourceKind::Ring)
    throw usage_error("{}: not a ring", flags.output)
        .remedy("for example lenticule farm feed DIR ring:/run/player.sock");
  const std::unique_ptr<FrameOutput> output =
      open_output({.target = flags.output,
                   .range = {plan.begin, plan.end},
                   .film = plan.film,
                   .ring_timeout_seconds = flags.ring_timeout});
  frames::WovenFrame frame(plan.film.geometry);
  player::Progress progress("feed", "frames", plan.end - plan.begin);
  uint64_t delivered = 0;
  for (uint64_t chunk = 0; chunk < plan.chunks(); ++chunk) {
    const auto report = await_chunk(folder, chunk);
    if (!report || !deliver_chunk(folder, *report, *output, frame)) break;
    delivered += report->end - report->begin;
    progress.update(delivered);
  }
  if (!player::interrupted()) output->finish();
  progress.finish();
  if (flags.json)
    print_json({{"frames", plan.end - plan.begin},
                {"frames_delivered", delivered},
                {"interrupted", player::interrupted()}});
  return player::interrupt_exit_code();
}

// lenticule farm merge joins the chunks of a plan into the film.

ExitCode farm_merge(const FarmFlags& flags) {
  const farm::WorkFolder folder(flags.folder);
  const farm::Plan& plan = folder.plan();
  const std::string film = flags.output.empty() ? plan.output : flags.output;
  require_replaceable_film({.target = film,
                            .range = {plan.begin, plan.end},
                            .film = plan.film,
                            .overwrite = flags.overwrite});
  player::Progress progress("merge", "chunks", plan.chunks());
  farm::MergeOptions options{.partial = flags.partial,
                             .wait = std::chrono::seconds(flags.wait_seconds)};
  options.stops = [&](uint64_t chunk) {
    progress.update(chunk);
    return player::interrupted();
  };
  const farm::MergeResult result = farm::merge_film(folder, film, options);
  if (result.stopped) return player::interrupt_exit_code();
  progress.update(result.chunks);
  progress.finish();
  print_result({{"output", film},
                {"frames", result.frames},
                {"chunks", result.chunks},
                {"bytes", result.bytes},
                {"complete", result.chunks == plan.chunks()}},
               flags.json, [&](const nlohmann::json&) {
                 print_out("{}: {} of {} frames, {} MiB\n", film, result.frames,
                           plan.end - plan.begin, result.bytes >> 20U);
               });
  return kOk;
}
}  // namespace lenticule::tools
