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

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "farm/chunk_report.h"
#include "farm/plan.h"
#include "frames/sequence/predictor_kernel.h"

namespace lenticule::farm {

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
  [[nodiscard]] virtual std::optional<FileFacts> look(const std::filesystem::path& file) const;
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

}  // namespace lenticule::farm
