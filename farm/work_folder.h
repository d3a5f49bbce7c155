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

#include <fmt/format.h>
#include <sys/stat.h>

#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/json_output.h"
#include "base/temporary.h"
#include "farm/plan.h"
#include "farm/sequence_joiner.h"
#include "frames/sequence/predictor_kernel.h"
#include "optics/json_fields.h"

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

/// ChunkProgress is written now and then by a process that renders a chunk.
struct ChunkProgress {
  std::string node{};
  uint64_t chunk = 0;
  uint64_t done = 0, count = 0;  ///< frames
  double seconds = 0.0;
};

/// ChunkFailure is written when a process gives up a chunk.
struct ChunkFailure {
  std::string node{};
  uint64_t chunk = 0;
  std::string error;
  std::string hint{};
};

/// Returns a ChunkReport, ChunkProgress or ChunkFailure as JSON.
template <class Record>
[[nodiscard]] std::string record_to_json(const Record& record);
/// Parses such a record. Throws Error(Input) that begins with `source`.
template <class Record>
[[nodiscard]] Record parse_record(std::string_view json, const std::string& source);

struct FileFacts {
  uint64_t bytes = 0;
  double changed = 0.0;  ///< seconds by the clock of the file system
};

inline constexpr uint64_t kMostPlanBytes = uint64_t{256} << 20;
inline constexpr const char* kPlanFile = "plan.json";

inline std::string numbered(uint64_t number, const char* rest) {
  return fmt::format("{:06}{}", number, rest);
}

inline double seconds_of(const timespec& time) {
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

inline bool is_valid(const frames::PredictorTable& table) {
  for (int i = 1; i <= table.count; ++i)
    if (table.distance[i] < frames::kBlockBytes) return false;
  return true;
}

/// Returns the text over which the checksum of published predictors is computed.
inline std::string predictors_text(const std::string& plan, uint64_t frame,
                                   const nlohmann::json& distances) {
  return fmt::format("{} {} {}", plan, frame, json_text(distances));
}

/// FolderFiles reads files by name. Tests replace it by one that is late, as network file systems
/// may be.
///
/// Thread safety: any thread.
class FolderFiles {
 public:
  virtual ~FolderFiles() = default;
  /// Returns the text, or none if there is no such file. Throws Error(Input) for other failures.
  [[nodiscard]] virtual std::optional<std::string> read(const std::filesystem::path& file) const {
    std::error_code error;
    if (!std::filesystem::exists(file, error)) return std::nullopt;
    return read_text_file(file, kMostPlanBytes);
  }
  /// Returns size and time, or none if there is no such file.
  [[nodiscard]] virtual std::optional<FileFacts> facts(const std::filesystem::path& file) const {
    struct stat status {};
    if (::stat(file.c_str(), &status) != 0) return std::nullopt;
    return FileFacts{.bytes = static_cast<uint64_t>(status.st_size),
                     .changed = seconds_of(status.st_mtim)};
  }
};

inline Plan read_plan(const std::filesystem::path& folder, const FolderFiles& files) {
  const std::filesystem::path file = folder / kPlanFile;
  const auto text = files.read(file);
  if (!text)
    throw input_error("{}: has no plan", folder.string())
        .remedy(
            "make one: lenticule farm plan SCENE --rig RIG --frames A:B -o FILM.lts --work DIR");
  return parse_plan(*text, file.string());
}

/// Creates a folder and those in which it lies. Throws Error(Failed).
inline void create_folders(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw failed_error("{}: cannot create: {}", folder.string(), error.message());
}

/// Renames a file, which replaces `to`. Throws Error(Failed).
inline void move_file(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (std::rename(from.c_str(), to.c_str()) != 0)
    throw failed_error("{}: cannot rename to {}: {}", from.string(), to.string(),
                       std::generic_category().message(errno));
}

/// Thread safety: any thread.
class WorkFolder {
 public:
  /// Opens a folder that has a plan. Throws Error(Input). Lifetime: `files` must outlive the
  /// folder.
  explicit WorkFolder(std::filesystem::path folder, const FolderFiles& files = plain_files())
      : folder_(std::move(folder)),
        files_(files),
        plan_(read_plan(folder_, files_)),
        identity_(plan_.identity()) {}

  /// Creates the folder with its plan and commands, unless it has the same plan already: then
  /// nothing changes. Throws Error(Input) if the folder has another plan, Error(Failed) if it
  /// cannot be written.
  static void create(const std::filesystem::path& folder, const Plan& plan,
                     const std::string& program) {
    if (const auto there = plan_in(folder)) {
      if (there->identity() == plan.identity() && there->output == plan.output) return;
      throw input_error("{}: has the plan of another film", folder.string())
          .remedy("use another folder, or remove this one");
    }
    const std::string commands = commands_text(plan, program, folder);
    for (const char* part : {"chunks", "reports", "predictors", "attempts", "failures"})
      create_folders(folder / part);
    write_text_file(folder / "commands.txt", commands);
    write_text_file(folder / kPlanFile, plan_to_json(plan));  // last: the folder is complete
  }
  /// Returns the plan in the folder, or none.
  [[nodiscard]] static std::optional<Plan> plan_in(const std::filesystem::path& folder) {
    std::error_code error;
    if (!std::filesystem::exists(folder / kPlanFile, error)) return std::nullopt;
    return read_plan(folder, plain_files());
  }
  [[nodiscard]] static const FolderFiles& plain_files() {
    static const FolderFiles files;
    return files;
  }

  [[nodiscard]] const Plan& plan() const { return plan_; }
  [[nodiscard]] const std::string& identity() const { return identity_; }
  [[nodiscard]] const std::filesystem::path& path() const { return folder_; }
  [[nodiscard]] const FolderFiles& files() const { return files_; }

  [[nodiscard]] std::filesystem::path report_file(uint64_t chunk) const {
    return folder_ / "reports" / numbered(chunk, ".json");
  }
  [[nodiscard]] std::filesystem::path differing_report_file(uint64_t chunk) const {
    return folder_ / "reports" / numbered(chunk, ".differs.json");
  }
  [[nodiscard]] std::filesystem::path chunk_file(const ChunkReport& report) const {
    return folder_ / "chunks" / fmt::format("{:06}-{}.lts", report.chunk, report.digest);
  }
  [[nodiscard]] std::filesystem::path attempts_folder(uint64_t chunk) const {
    return folder_ / "attempts" / numbered(chunk, "");
  }
  [[nodiscard]] std::filesystem::path failure_file(uint64_t chunk) const {
    return folder_ / "failures" / numbered(chunk, ".json");
  }
  [[nodiscard]] std::filesystem::path predictors_file(uint64_t frame) const {
    return folder_ / "predictors" / numbered(frame, ".json");
  }

  /// Returns the report of a chunk that is done: the report belongs to this plan, and the chunk's
  /// file has the reported size. Otherwise returns none.
  [[nodiscard]] std::optional<ChunkReport> done(uint64_t chunk) const {
    auto found = report(chunk);
    if (!found) return std::nullopt;
    const auto file = files_.facts(chunk_file(*found));
    return file && file->bytes == found->bytes ? found : std::nullopt;
  }
  /// Returns the report whatever the chunk's file is like; none if it is missing, is not a report
  /// or belongs to another plan.
  [[nodiscard]] std::optional<ChunkReport> report(uint64_t chunk) const {
    return read_report(report_file(chunk), chunk);
  }
  /// Returns the report of a process that rendered other bytes than report() says.
  [[nodiscard]] std::optional<ChunkReport> differing_report(uint64_t chunk) const {
    return read_report(differing_report_file(chunk), chunk);
  }
  /// Removes the report of a chunk whose file is damaged, so that the chunk counts as missing.
  void forget(uint64_t chunk) const {
    std::error_code error;
    std::filesystem::remove(report_file(chunk), error);
  }

  /// Returns the predictors that a process has published for a frame of the film; none if there are
  /// none, or they belong to another plan or are damaged.
  [[nodiscard]] std::optional<frames::PredictorTable> predictors(uint64_t frame) const {
    const std::filesystem::path file = predictors_file(frame);
    try {
      const auto text = files_.read(file);
      if (!text) return std::nullopt;
      const nlohmann::json object = optics::parse_json(*text, file.string());
      const optics::JsonFields fields(object, file.string());
      const std::vector<uint64_t> distances = fields.wholes("distances", UINT32_MAX);
      if (distances.size() > frames::kMaxPredictors) return std::nullopt;
      frames::PredictorTable table;
      for (const uint64_t distance : distances)
        table.distance[++table.count] = static_cast<uint32_t>(distance);
      const std::string checked = predictors_text(identity_, frame, distances);
      if (fields.text("digest") != digest_of_text(checked) || !is_valid(table)) return std::nullopt;
      return table;
    } catch (const Error&) {
      return std::nullopt;  // the frame is rendered again
    }
  }
  /// Publishes predictors, by way of a file in the folder `attempt`.
  void publish_predictors(uint64_t frame, const frames::PredictorTable& predictors,
                          const std::filesystem::path& attempt) const {
    nlohmann::json distances = nlohmann::json::array();
    for (int i = 1; i <= predictors.count; ++i) distances.push_back(predictors.distance[i]);
    const std::string digest = digest_of_text(predictors_text(identity_, frame, distances));
    const std::filesystem::path made = attempt / "predictors.json";
    write_text_file(made,
                    json_text(nlohmann::json{{"distances", distances}, {"digest", digest}}) + "\n");
    move_file(made, predictors_file(frame));
  }

  /// Makes a chunk done: moves its file, then its report out of the folder `attempt`. Does nothing
  /// if another process has reported the same bytes before. Returns false if it has reported other
  /// bytes; the report is then kept as the differing one. Throws Error(Failed).
  [[nodiscard]] bool finish_chunk(const std::filesystem::path& attempt,
                                  const std::filesystem::path& file,
                                  const ChunkReport& report) const {
    const auto there = done(report.chunk);
    // A file that is the same already stays: a process on another node may be reading it, and a
    // network file system takes a file away from its readers when another one is renamed to its
    // name.
    if (there && there->digest == report.digest) return true;
    const bool differs = there.has_value();
    move_file(file, chunk_file(report));
    sync_folder_of(chunk_file(report));  // the report must not survive a power cut without the file
    const std::filesystem::path made = attempt / "report.json";
    write_text_file(made, record_to_json(report));
    move_file(made, differs ? differing_report_file(report.chunk) : report_file(report.chunk));
    return !differs;
  }

 private:
  [[nodiscard]] std::optional<ChunkReport> read_report(const std::filesystem::path& file,
                                                       uint64_t chunk) const {
    try {
      const auto text = files_.read(file);
      if (!text) return std::nullopt;
      ChunkReport report = parse_record<ChunkReport>(*text, file.string());
      const Chunk expected = plan_.chunk(chunk);
      const bool plain = report.digest.find_first_not_of("0123456789abcdef") == std::string::npos;
      if (report.plan != identity_ || report.chunk != chunk || report.begin != expected.begin ||
          report.end != expected.end || !plain)
        return std::nullopt;
      return report;
    } catch (const Error&) {
      return std::nullopt;  // damaged: the chunk is rendered again
    }
  }

  std::filesystem::path folder_;
  const FolderFiles& files_;
  Plan plan_;
  std::string identity_;
};

struct MergeOptions {
  bool partial = false;  ///< join the frames before the first chunk that is not done
  /// Longest time to wait for chunks that are missing: the folder of a network file system may show
  /// a file some seconds late.
  std::chrono::seconds wait{0};
  /// Called before each chunk; returning true stops the merge.
  std::function<bool(uint64_t chunk)> stops = [](uint64_t) { return false; };
  /// Pauses between two looks for missing chunks; tests replace it.
  std::function<void(std::chrono::milliseconds)> pause = [](std::chrono::milliseconds time) {
    std::this_thread::sleep_for(time);
  };
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
