// SPDX-License-Identifier: Apache-2.0
// Plan describes how a film is rendered in parts (chunks) by many processes that share only a
// folder. Its identity covers everything that the film's bytes depend on.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "frames/sequence/sequence_format.h"

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

  [[nodiscard]] uint64_t chunks() const;
  /// Returns chunk `number`, which must be less than chunks().
  [[nodiscard]] Chunk chunk(uint64_t number) const;
  /// Returns 32 hexadecimal digits that are equal for plans of the same film in the same chunks.
  [[nodiscard]] std::string identity() const;
};

/// Limits of a plan, which parse_plan() checks.
inline constexpr uint64_t kMostChunks = 1'000'000;

[[nodiscard]] std::string plan_to_json(const Plan& plan);
/// Parses a plan. Throws Error(Input) that begins with `source` for invalid JSON, missing keys,
/// values out of range, and a plan that was edited after it was made.
[[nodiscard]] Plan parse_plan(std::string_view json, const std::string& source);

/// Returns the number of frames in a chunk for which starting and rendering a key frame twice (see
/// frames::SequencePart) cost at most a twentieth of the chunk, and a chunk takes two minutes or
/// more.
[[nodiscard]] uint64_t choose_chunk_frames(const FrameTiming& timing, uint64_t film_frames,
                                           uint64_t method_interval);

/// Returns the numbers of all chunks in the order in which they should be started: that of their
/// frames. Chunks that publish predictors come some hundred frames earlier, so that most chunks
/// that need these find them.
[[nodiscard]] std::vector<uint64_t> chunk_order(const Plan& plan);

/// Returns the command of each chunk in that order, one in a line, for a POSIX shell. Throws
/// Error(Usage) for a path with a line end, which no list of lines can contain.
[[nodiscard]] std::string commands_text(const Plan& plan, const std::string& program,
                                        const std::filesystem::path& folder);

}  // namespace lenticule::farm
