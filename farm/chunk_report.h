// SPDX-License-Identifier: Apache-2.0
// ChunkReport states what a process has rendered. A chunk is done when its report is in the work
// folder: the report is written after the chunk's file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace lenticule::farm {

struct ChunkReport {
  std::string plan;  ///< identity of the plan
  uint64_t chunk = 0;
  uint64_t begin = 0, end = 0;                        ///< frames
  std::string digest{};                               ///< of the chunk's file
  uint64_t bytes = 0;                                 ///< of the chunk's file
  std::vector<uint64_t> first_bands{}, last_bands{};  ///< see frames::FilmPart
  std::string node{};
  std::string isa{};  ///< instruction set that rendered
  int threads = 0;
  double seconds = 0.0;         ///< whole process
  double render_seconds = 0.0;  ///< frames of the chunk, with their scenes
  double extra_seconds = 0.0;   ///< frames that others render, too
  double started = 0.0;         ///< seconds since 1970 by the node's clock, for people only
  friend bool operator==(const ChunkReport&, const ChunkReport&) = default;
};

[[nodiscard]] std::string chunk_report_to_json(const ChunkReport& report);
/// Parses a report. Throws Error(Input) that begins with `source`.
[[nodiscard]] ChunkReport parse_chunk_report(std::string_view json, const std::string& source);

/// ChunkProgress is written now and then by a process that renders a chunk.
struct ChunkProgress {
  std::string node{};
  uint64_t chunk = 0;
  uint64_t done = 0, count = 0;  ///< frames
  double seconds = 0.0;
};
[[nodiscard]] std::string chunk_progress_to_json(const ChunkProgress& progress);
[[nodiscard]] ChunkProgress parse_chunk_progress(std::string_view json, const std::string& source);

/// ChunkFailure is written when a process gives up a chunk.
struct ChunkFailure {
  std::string node{};
  uint64_t chunk = 0;
  std::string error;
  std::string hint{};
};
[[nodiscard]] std::string chunk_failure_to_json(const ChunkFailure& failure);
[[nodiscard]] ChunkFailure parse_chunk_failure(std::string_view json, const std::string& source);

}  // namespace lenticule::farm
