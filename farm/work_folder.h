// SPDX-License-Identifier: Apache-2.0
// WorkFolder is the folder through which all processes of a farm communicate. They need nothing of
// it but that a rename within the folder is atomic and a file that was closed can be read by name.
// No process waits for a lock, and none relies on a listing: a chunk is looked up by its name.
//
//   plan.json            the plan; written once
//   commands.txt         the commands of all chunks
//   chunks/N-DIGEST.lts  frames of chunk N, named by their content
//   reports/N.json       report of chunk N, written after its file: the chunk is done
//   reports/N.differs.json   report of a process that rendered other bytes
//   predictors/N.json    predictors of frame N, which several chunks need
//   attempts/N/*         chunk N in progress, a folder for each process
//   failures/N.json      the last failure of chunk N
//   slurm/               script, logs and job numbers
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "farm/plan.h"
#include "frames/sequence/predictor_kernel.h"

namespace lenticule::farm {

/// ChunkReport states what a process has rendered. A chunk is done when its report is in the work
/// folder: the report is written after the chunk's file.
struct ChunkReport {
  std::string plan;  ///< identity of the plan
  uint64_t chunk = 0;
  uint64_t begin = 0, end = 0;                        ///< frames
  std::string digest{};                               ///< digest of the chunk's file
  uint64_t bytes = 0;                                 ///< size of the chunk's file
  std::vector<uint64_t> first_bands{}, last_bands{};  ///< see FilmPart
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

struct FileFacts {
  uint64_t bytes = 0;
  double changed = 0.0;  ///< seconds by the clock of the file system
};

/// FolderFiles reads files by name. Tests replace it by one that is late, as network file systems
/// may be.
///
/// Thread safety: any thread.
class FolderFiles {
 public:
  virtual ~FolderFiles() = default;
  /// Returns the text, or none if there is no such file. Throws Error(Input) for other failures.
  [[nodiscard]] virtual std::optional<std::string> read(const std::filesystem::path& file) const;
  /// Returns size and time, or none if there is no such file.
  [[nodiscard]] virtual std::optional<FileFacts> facts(const std::filesystem::path& file) const;
};

/// Thread safety: any thread.
class WorkFolder {
 public:
  /// Opens a folder that has a plan. Throws Error(Input). Lifetime: `files` must outlive the
  /// folder.
  explicit WorkFolder(std::filesystem::path folder, const FolderFiles& files = plain_files());

  /// Creates the folder with its plan and commands, unless it has the same plan already: then
  /// nothing changes. Throws Error(Input) if the folder has another plan, Error(Failed) if it
  /// cannot be written.
  static void create(const std::filesystem::path& folder, const Plan& plan,
                     const std::string& program);
  /// Returns the plan in the folder, or none.
  [[nodiscard]] static std::optional<Plan> plan_in(const std::filesystem::path& folder);
  [[nodiscard]] static const FolderFiles& plain_files();

  [[nodiscard]] const Plan& plan() const { return plan_; }
  [[nodiscard]] const std::string& identity() const { return identity_; }
  [[nodiscard]] const std::filesystem::path& path() const { return folder_; }
  [[nodiscard]] const FolderFiles& files() const { return files_; }

  [[nodiscard]] std::filesystem::path report_file(uint64_t chunk) const;
  [[nodiscard]] std::filesystem::path differing_report_file(uint64_t chunk) const;
  [[nodiscard]] std::filesystem::path chunk_file(const ChunkReport& report) const;
  [[nodiscard]] std::filesystem::path attempts_folder(uint64_t chunk) const;
  [[nodiscard]] std::filesystem::path failure_file(uint64_t chunk) const;
  [[nodiscard]] std::filesystem::path predictors_file(uint64_t frame) const;

  /// Returns the report of a chunk that is done: the report belongs to this plan, and the chunk's
  /// file has the reported size. Otherwise returns none.
  [[nodiscard]] std::optional<ChunkReport> done(uint64_t chunk) const;
  /// Returns the report whatever the chunk's file is like; none if it is missing, is not a report
  /// or belongs to another plan.
  [[nodiscard]] std::optional<ChunkReport> report(uint64_t chunk) const;
  /// Returns the report of a process that rendered other bytes than report() says.
  [[nodiscard]] std::optional<ChunkReport> differing_report(uint64_t chunk) const;
  /// Removes the report of a chunk whose file is damaged, so that the chunk counts as missing.
  void forget(uint64_t chunk) const;

  /// Returns the predictors that a process has published for a frame of the film; none if there are
  /// none, or they belong to another plan or are damaged.
  [[nodiscard]] std::optional<frames::PredictorTable> predictors(uint64_t frame) const;
  /// Publishes predictors, by way of a file in the folder `attempt`.
  void publish_predictors(uint64_t frame, const frames::PredictorTable& predictors,
                          const std::filesystem::path& attempt) const;

  /// Makes a chunk done: moves its file, then its report out of the folder `attempt`. Does nothing
  /// if another process has reported the same bytes before. Returns false if it has reported other
  /// bytes; the report is then kept as the differing one. Throws Error(Failed).
  [[nodiscard]] bool finish_chunk(const std::filesystem::path& attempt,
                                  const std::filesystem::path& file,
                                  const ChunkReport& report) const;

 private:
  [[nodiscard]] std::optional<ChunkReport> read_report(const std::filesystem::path& file,
                                                       uint64_t chunk) const;

  std::filesystem::path folder_;
  const FolderFiles& files_;
  Plan plan_;
  std::string identity_;
};

/// Renames a file, which replaces `to`. Throws Error(Failed).
void move_file(const std::filesystem::path& from, const std::filesystem::path& to);

struct MergeOptions {
  bool partial = false;  ///< join the frames before the first chunk that is not done
  /// Longest time to wait for chunks that are missing: the folder of a network file system may show
  /// a file some seconds late.
  std::chrono::seconds wait{0};
  /// Called before each chunk; returning true stops the merge.
  std::function<bool(uint64_t chunk)> stops = [](uint64_t) { return false; };
  /// Pauses between two looks for missing chunks; tests replace it.
  std::function<void(std::chrono::milliseconds)> pause{};
};

struct MergeResult {
  uint64_t frames = 0;
  uint64_t chunks = 0;
  uint64_t bytes = 0;
  bool stopped = false;  ///< nothing was written
};

/// Returns the numbers of the chunks that are not done.
[[nodiscard]] std::vector<uint64_t> missing_chunks(const WorkFolder& folder);

/// Joins the chunks of a plan to the film, with the bytes that one process writes in one run.
/// Throws Error(Input) that names the chunks if some are missing, damaged or were rendered with
/// other bytes by two processes; a damaged chunk counts as missing from then on. Throws
/// Error(Failed) if the film cannot be written. An existing film stays unchanged if anything fails.
MergeResult merge_film(const WorkFolder& folder, const std::filesystem::path& film,
                       const MergeOptions& options = {});

/// Returns chunk numbers as "0-3,7".
[[nodiscard]] std::string ranges_text(const std::vector<uint64_t>& numbers);

// read_status finds out how far a farm is, from the files of the work folder alone, so that it
// works with every engine. Clocks of nodes are never compared: times are those that the file system
// gives to files.

struct RunningChunk {
  ChunkProgress progress;
  double silent_seconds = 0.0;  ///< since the process last reported
};

struct NodeStatus {
  std::string node;
  uint64_t chunks = 0;
  uint64_t frames = 0;
  uint64_t running = 0;
  double frame_seconds = 0.0;  ///< mean time of a frame
};

struct SlowChunk {
  uint64_t chunk = 0;
  std::string node;
  double seconds = 0.0;
};

struct FarmStatus {
  uint64_t chunks = 0, frames = 0;
  uint64_t chunks_done = 0, frames_done = 0;
  uint64_t bytes_done = 0;
  std::vector<RunningChunk> running{};  ///< the chunks that are not done
  std::vector<ChunkFailure> failed{};   ///< not done and not running
  std::vector<uint64_t> missing{};      ///< not done, not running and not failed
  std::vector<uint64_t> differing{};    ///< rendered with other bytes by two processes
  std::vector<SlowChunk> slowest{};     ///< the slowest first
  std::vector<NodeStatus> nodes{};      ///< sorted by name
  double frames_per_second = 0.0;       ///< mean of the last ten minutes; 0: unknown
  std::optional<double> seconds_left{};
  bool merged = false;  ///< the film exists

  [[nodiscard]] bool complete() const { return chunks_done == chunks; }
};

/// A process that has not reported for this time is not counted as running: it was killed, or its
/// node is gone.
inline constexpr double kSilentSeconds = 300.0;

/// Returns the time by the clock of the folder's file system, in seconds.
[[nodiscard]] double folder_time(const std::filesystem::path& folder);

[[nodiscard]] FarmStatus read_status(const WorkFolder& folder, double now);

[[nodiscard]] nlohmann::json status_json(const FarmStatus& status);
/// Returns lines for people.
[[nodiscard]] std::string status_text(const FarmStatus& status);

}  // namespace lenticule::farm
