// SPDX-License-Identifier: Apache-2.0
// Plan describes how a film is rendered in parts (chunks) by many processes that share only a
// folder. Its identity covers everything that the film's bytes depend on.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <string_view>
#include <vector>

#include "base/error_kinds.h"
#include "base/text.h"
#include "farm/sequence_joiner.h"
#include "frames/sequence/band_codec.h"
#include "frames/sequence/sequence_format.h"
#include "optics/json_fields.h"

namespace lenticule::farm {

/// FrameTiming is the measured cost of the frames that were rendered for planning.
struct FrameTiming {
  int frames = 0;              ///< number of timed frames; 0: not measured
  double start_seconds = 0.0;  ///< loading the scene and starting
  double frame_seconds = 0.0;  ///< median
  double slowest_seconds = 0.0;
  uint64_t peak_bytes = 0;  ///< largest memory of the process
  int threads = 0;          ///< threads that rendered
};

/// Frames [begin, end) of the film's numbering.
struct Chunk {
  uint64_t number = 0;
  uint64_t begin = 0;
  uint64_t end = 0;
  [[nodiscard]] uint64_t count() const { return end - begin; }
};

struct Plan {
  std::string program;                 ///< name and version
  std::vector<std::string> arguments;  ///< of `lenticule render`, without --frames and --output
  uint64_t begin = 0, end = 0;         ///< frames of the film
  uint64_t chunk_frames = 1;           ///< the last chunk may have fewer
  frames::SequenceInfo film;           ///< metadata of the film
  std::map<std::string, std::string> inputs;  ///< digest of each input, by what it is
  std::vector<std::string> chunk_inputs;      ///< digests of inputs of each chunk's own, or empty
  // Not part of the identity:
  std::string output;  ///< absolute path of the film
  FrameTiming timing;

  [[nodiscard]] uint64_t chunks() const { return (end - begin + chunk_frames - 1) / chunk_frames; }
  /// Returns chunk `number`, which must be less than chunks().
  [[nodiscard]] Chunk chunk(uint64_t number) const {
    LENTICULE_CHECK(number < chunks());
    const uint64_t first = begin + number * chunk_frames;
    return {.number = number, .begin = first, .end = std::min(end, first + chunk_frames)};
  }
  /// Returns what the identity covers.
  [[nodiscard]] nlohmann::json result_json() const {
    return {{"program", program},
            {"arguments", arguments},
            {"frames", {begin, end}},
            {"chunk_frames", chunk_frames},
            {"width", film.geometry.width},
            {"height", film.geometry.height},
            {"film", nlohmann::json::parse(frames::sequence_info_to_json(film))},
            {"inputs", inputs},
            {"chunk_inputs", chunk_inputs},
            {"processors",
             "every processor and instruction set gives the same bytes; farm verify checks it"}};
  }
  /// Returns 32 hexadecimal digits that are equal for plans of the same film in the same chunks.
  [[nodiscard]] std::string identity() const { return digest_of_text(json_text(result_json())); }
};

/// Limits of a plan, which parse_plan() checks.
inline constexpr uint64_t kMostChunks = 1'000'000;
inline constexpr int kPlanFormat = 1;

inline nlohmann::json timing_json(const FrameTiming& timing) {
  return {{"frames", timing.frames},
          {"start_seconds", timing.start_seconds},
          {"frame_seconds", timing.frame_seconds},
          {"slowest_seconds", timing.slowest_seconds},
          {"peak_bytes", timing.peak_bytes},
          {"threads", timing.threads}};
}

[[nodiscard]] inline std::string plan_to_json(const Plan& plan) {
  const nlohmann::json object = {
      {"format", kPlanFormat}, {"identity", plan.identity()}, {"result", plan.result_json()},
      {"output", plan.output}, {"chunks", plan.chunks()},     {"timing", timing_json(plan.timing)}};
  return json_text(object, 1) + "\n";
}

inline FrameTiming parse_timing(const optics::JsonFields& fields) {
  constexpr uint64_t kMost = 1'000'000;
  return {.frames = static_cast<int>(fields.whole("frames", kMost)),
          .start_seconds = fields.number("start_seconds", 0.0),
          .frame_seconds = fields.number("frame_seconds", 0.0),
          .slowest_seconds = fields.number("slowest_seconds", 0.0),
          .peak_bytes = fields.whole("peak_bytes", UINT64_MAX),
          .threads = static_cast<int>(fields.whole("threads", kMost))};
}

inline constexpr uint64_t kMostFrameNumber = 1'000'000'000;

inline void parse_frames(const optics::JsonFields& fields, Plan& plan) {
  const std::vector<uint64_t> range = fields.wholes("frames", kMostFrameNumber);
  if (range.size() != 2) fields.fail("frames", "not two frame numbers");
  plan.begin = range[0];
  plan.end = range[1];
  if (plan.end <= plan.begin) fields.fail("frames", "contains no frame");
  if (plan.end - plan.begin > frames::kMaxSequenceFrames)
    fields.fail("frames", "more than a film can hold");
  plan.chunk_frames = fields.whole("chunk_frames", frames::kMaxSequenceFrames);
  if (plan.chunk_frames == 0) fields.fail("chunk_frames", "zero");
  if (plan.chunks() > kMostChunks)
    fields.fail("chunk_frames", fmt::format("more than {} chunks", kMostChunks));
}

inline void parse_inputs(const optics::JsonFields& fields, Plan& plan) {
  const nlohmann::json& inputs = fields.need("inputs");
  if (!inputs.is_object()) fields.fail("inputs", "not an object");
  for (const auto& [what, digest] : inputs.items()) {
    if (!digest.is_string()) fields.fail("inputs", "not a digest");
    plan.inputs[what] = digest.get<std::string>();
  }
  plan.chunk_inputs = fields.texts("chunk_inputs");
  if (!plan.chunk_inputs.empty() && plan.chunk_inputs.size() != plan.chunks())
    fields.fail("chunk_inputs", "not one for each chunk");
}

/// Parses a plan. Throws Error(Input) that begins with `source` for invalid JSON, missing keys,
/// values out of range, and a plan that was edited after it was made.
[[nodiscard]] inline Plan parse_plan(std::string_view text, const std::string& source) {
  const nlohmann::json object = optics::parse_json(text, source);
  const optics::JsonFields fields(object, source);
  if (fields.whole("format", UINT64_MAX) != kPlanFormat)
    throw input_error("{}: another format of plans", source)
        .remedy("use the version of lenticule that made the plan");
  const optics::JsonFields result(fields.need("result"), source);
  Plan plan;
  plan.program = result.text("program");
  plan.arguments = result.texts("arguments");
  parse_frames(result, plan);
  constexpr auto kMost = static_cast<uint64_t>(frames::kMaxSequencePixels);
  const frames::FrameGeometry geometry{.width = static_cast<int>(result.whole("width", kMost)),
                                       .height = static_cast<int>(result.whole("height", kMost))};
  if (!frames::can_hold(geometry)) result.fail("width", "frames cannot have this width and height");
  plan.film = frames::parse_sequence_info(json_text(result.need("film")), geometry, source);
  parse_inputs(result, plan);
  plan.output = fields.text("output");
  plan.timing = parse_timing(optics::JsonFields(fields.need("timing"), source));
  if (plan.identity() != fields.text("identity"))
    throw input_error("{}: was changed after it was made", source)
        .remedy("make it again with lenticule farm plan, in a new folder");
  return plan;
}

/// A chunk of this length loses little if its node fails, and is no burden for a scheduler.
inline constexpr double kChunkSeconds = 120.0;

/// Largest number of chunks that is chosen: each costs a scheduler and a file system some work.
inline constexpr uint64_t kManyChunks = 10'000;

/// Largest part of a chunk's time that is spent on other things than its frames.
inline constexpr double kMostOverhead = 0.05;

/// Returns the part of the work that is rendering key frames of other chunks: chunks that begin
/// within an interval render the interval's first frame, too.
inline double key_frame_overhead(uint64_t chunk_frames, uint64_t interval) {
  const auto chunk = static_cast<double>(chunk_frames);
  const auto aligned =
      static_cast<double>(std::gcd(chunk_frames, interval)) / static_cast<double>(interval);
  return (1.0 - aligned) / chunk;
}

/// Returns the number of frames in a chunk for which starting and rendering a key frame twice (see
/// frames::SequencePart) cost at most a twentieth of the chunk, and a chunk takes two minutes or
/// more.
[[nodiscard]] inline uint64_t choose_chunk_frames(const FrameTiming& timing, uint64_t film_frames,
                                                  uint64_t method_interval) {
  const uint64_t interval =
      std::lcm(frames::kPredictorInterval, std::max<uint64_t>(1, method_interval));
  const double frame = std::max(timing.frame_seconds, 1e-6);
  const auto wanted = std::max(static_cast<uint64_t>(std::ceil(kChunkSeconds / frame)),
                               (film_frames + kManyChunks - 1) / kManyChunks);
  for (uint64_t frames = std::min(wanted, film_frames); frames < film_frames; ++frames) {
    // Whole intervals cost nothing, so a longer chunk is rounded to them.
    if (frames > interval) frames = (frames + interval - 1) / interval * interval;
    const double start = timing.start_seconds / (frame * static_cast<double>(frames));
    const uint64_t repeated = method_interval > 1 ? method_interval : 1;
    if (start + static_cast<double>(repeated) * key_frame_overhead(frames, interval) <=
        kMostOverhead)
      return std::min(frames, film_frames);
  }
  return film_frames;
}

/// A thousand nodes that render chunks of one frame are this far apart.
inline constexpr int64_t kPublishEarlierFrames = 1024;

/// Returns the numbers of all chunks in the order in which they should be started: that of their
/// frames. Chunks that publish predictors come some hundred frames earlier, so that most chunks
/// that need these find them.
[[nodiscard]] inline std::vector<uint64_t> chunk_order(const Plan& plan) {
  std::vector<uint64_t> order(plan.chunks());
  std::iota(order.begin(), order.end(), uint64_t{0});
  const auto place = [&plan](uint64_t number) {
    const Chunk chunk = plan.chunk(number);
    const uint64_t first = chunk.begin - plan.begin;
    const uint64_t last = chunk.end - plan.begin - 1;
    const bool publishes = first % frames::kPredictorInterval == 0 ||
                           first / frames::kPredictorInterval < last / frames::kPredictorInterval;
    return static_cast<int64_t>(first) - (publishes ? kPublishEarlierFrames : 0);
  };
  std::ranges::stable_sort(order, [&](uint64_t a, uint64_t b) { return place(a) < place(b); });
  return order;
}

/// Returns the command of each chunk in that order, one in a line, for a POSIX shell. Throws
/// Error(Usage) for a path with a line end, which no list of lines can contain.
[[nodiscard]] inline std::string commands_text(const Plan& plan, const std::string& program,
                                               const std::filesystem::path& folder) {
  if (folder.string().find('\n') != std::string::npos || program.find('\n') != std::string::npos)
    throw Error(ErrorKind::Usage, "a path with a line end cannot be in a list of commands",
                "use a work folder of another name");
  const std::string command =
      fmt::format("{} farm render {}", shell_quoted(program), shell_quoted(folder.string()));
  std::string text;
  for (const uint64_t chunk : chunk_order(plan)) text += fmt::format("{} {}\n", command, chunk);
  return text;
}

}  // namespace lenticule::farm
