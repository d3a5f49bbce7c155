// SPDX-License-Identifier: Apache-2.0
// lenticule farm plan writes the work folder of a film that many processes render.
#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <set>
#include <thread>

#include "apps/lenticule-tools/farm/actions.h"
#include "apps/lenticule-tools/farm/planned_film.h"
#include "apps/lenticule-tools/offline/existing_output.h"
#include "apps/lenticule-tools/offline/sequence_output.h"
#include "base/error.h"
#include "base/json_output.h"
#include "base/numbers.h"
#include "base/print.h"
#include "base/statistics.h"
#include "farm/work_folder.h"
#include "frames/sequence/predictor_choice.h"
#include "player/process/child_process.h"
#include "player/process/interrupt.h"

namespace lenticule::tools {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

uint64_t peak_resident_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<uint64_t>(usage.ru_maxrss) * 1024;
}

/// Returns the frames to be timed, spread over the film.
std::set<uint64_t> frames_to_time(const player::FrameRange& film, int count) {
  std::set<uint64_t> frames;
  const auto wanted = static_cast<uint64_t>(count);
  for (uint64_t i = 0; i < wanted; ++i)
    frames.insert(film.begin + (2 * i + 1) * film.count() / (2 * wanted));
  return frames;
}

/// Renders some frames. A frame on which others depend is timed with them.
farm::FrameTiming time_frames(FilmRenderer& renderer, const FarmPlanFlags& flags,
                              double start_seconds) {
  farm::FrameTiming timing{.start_seconds = start_seconds};
  const int threads = flags.render.options.threads;
  timing.threads =
      threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  std::vector<double> seconds;
  frames::WovenFrame frame(renderer.geometry());
  for (const uint64_t number : frames_to_time(renderer.film(), flags.timed_frames)) {
    int rendered = 0;
    const auto count = [&](const render::RenderStatistics&, bool) { ++rendered; };
    const auto begin = Clock::now();
    if (!renderer.render(number, frame, player::interrupted, count)) return timing;
    seconds.push_back(seconds_since(begin) / std::max(1, rendered));
  }
  timing.frames = static_cast<int>(seconds.size());
  timing.frame_seconds = median(seconds);
  timing.slowest_seconds = quantile(seconds, 1.0);
  timing.peak_bytes = peak_resident_bytes();
  return timing;
}

/// Returns the number of frames after which the method begins anew; 1 if every frame is on its own.
uint64_t method_interval(const FilmRenderer& renderer) {
  constexpr uint64_t kLast = frames::kPredictorInterval - 1;
  return renderer.method().first_needed(kLast) < kLast ? frames::kPredictorInterval : 1;
}

uint64_t parse_chunk(const std::string& text) {
  const auto frames = number_from<uint64_t>(text);
  if (!frames || *frames == 0)
    throw Error(ErrorKind::Usage, fmt::format("--chunk '{}': not a number of frames", text),
                "for example --chunk 32, or --chunk auto");
  return *frames;
}

nlohmann::json plan_result(const FarmPlanFlags& flags, const farm::Plan& plan) {
  return {{"work", flags.work},
          {"output", plan.output},
          {"frames", plan.end - plan.begin},
          {"chunks", plan.chunks()},
          {"chunk_frames", plan.chunk_frames},
          {"identity", plan.identity()},
          {"commands", (std::filesystem::path(flags.work) / "commands.txt").string()},
          {"frame_seconds", plan.timing.frame_seconds},
          {"start_seconds", plan.timing.start_seconds}};
}

void print_plan(const farm::Plan& plan, const std::filesystem::path& folder) {
  print_out("{} frames in {} chunks of {} frames\n", plan.end - plan.begin, plan.chunks(),
            plan.chunk_frames);
  if (plan.timing.frames > 0)
    print_out("{:.2f} s per frame with {} threads, {:.1f} s to start, {} MiB\n",
              plan.timing.frame_seconds, plan.timing.threads, plan.timing.start_seconds,
              plan.timing.peak_bytes >> 20U);
  print_out("commands: {}\n", folder / "commands.txt");
}

void require_film_name(const FarmPlanFlags& flags) {
  if (!flags.output.ends_with(".lts"))
    throw Error(ErrorKind::Usage, fmt::format("-o {}: a farm makes films", flags.output),
                "use a name that ends in .lts; lenticule convert makes pictures and videos of it");
  if (flags.timed_frames == 0 && flags.chunk == "auto")
    throw Error(ErrorKind::Usage, "--chunk auto: needs timed frames",
                "leave out --timed-frames 0, or give a number: --chunk 32");
}

}  // namespace

std::string farm_program(const std::string& given) {
  if (!given.empty()) return given;
  const auto program = player::find_sibling_program("lenticule");
  return program ? std::filesystem::weakly_canonical(*program).string() : "lenticule";
}

ExitCode farm_plan(const FarmPlanFlags& flags) {
  require_film_name(flags);
  const std::filesystem::path folder = std::filesystem::absolute(flags.work).lexically_normal();
  const player::FrameRange range = player::parse_frame_range(flags.render.frames);
  const auto begin = Clock::now();
  FilmRenderer renderer(flags.render, range);
  OutputRequest request =
      renderer.output_request(std::filesystem::absolute(flags.output).string(), range);
  request.overwrite = flags.overwrite;
  require_replaceable_film(request);

  farm::Plan plan;
  plan.program = program_version();
  plan.arguments = flags.arguments;
  plan.begin = range.begin;
  plan.end = range.end;
  plan.film = sequence_info_of(request);
  plan.inputs = digests_of_inputs(flags.render, renderer);
  plan.output = request.target;
  const auto there = farm::WorkFolder::plan_in(folder);
  if (there && flags.chunk == "auto") {
    plan.chunk_frames = there->chunk_frames;  // the same plan again
    plan.timing = there->timing;
  } else {
    plan.timing = time_frames(renderer, flags, seconds_since(begin));
    if (player::interrupted()) return player::interrupt_exit_code();
    plan.chunk_frames =
        flags.chunk == "auto"
            ? farm::choose_chunk_frames(plan.timing, range.count(), method_interval(renderer))
            : std::min(parse_chunk(flags.chunk), range.count());
  }
  if (plan.chunks() > farm::kMostChunks)
    throw Error(ErrorKind::Usage,
                fmt::format("--chunk {}: more than {} chunks", flags.chunk, farm::kMostChunks));
  for (uint64_t chunk = 0; chunk < plan.chunks(); ++chunk) {
    const std::string digest = digest_of_chunk_inputs(flags.render, plan.chunk(chunk));
    if (digest.empty()) break;
    plan.chunk_inputs.push_back(digest);
  }
  if (farm::parse_plan(farm::plan_to_json(plan), "plan").arguments != plan.arguments)
    throw Error(ErrorKind::Usage, "a file's name is not UTF-8, which a plan cannot contain",
                "rename the file");
  farm::WorkFolder::create(folder, plan, farm_program(flags.program));
  if (flags.json) {
    print_json(plan_result(flags, plan));
  } else {
    print_plan(plan, folder);
  }
  return kOk;
}

}  // namespace lenticule::tools
