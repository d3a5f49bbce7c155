// SPDX-License-Identifier: Apache-2.0
#include "farm/work_folder.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstdio>
#include <system_error>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"
#include "farm/json_fields.h"
#include "frames/sequence/sequence_joiner.h"

namespace lenticule::farm {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr uint64_t kMostPlanBytes = uint64_t{256} << 20;
constexpr const char* kPlanFile = "plan.json";

std::string numbered(uint64_t number, const char* rest) {
  return fmt::format("{:06}{}", number, rest);
}

double seconds_of(const timespec& time) {
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

bool is_valid(const frames::PredictorTable& table) {
  for (int i = 1; i <= table.count; ++i)
    if (table.distance[i] < frames::kBlockBytes) return false;
  return true;
}

/// Returns the text over which the checksum of published predictors is computed.
std::string predictors_text(const std::string& plan, uint64_t frame, const json& distances) {
  return fmt::format("{} {} {}", plan, frame, json_text(distances));
}

Plan read_plan(const fs::path& folder, const FolderFiles& files) {
  const fs::path file = folder / kPlanFile;
  const auto text = files.read(file);
  if (!text)
    throw Error(
        ErrorKind::Input, fmt::format("{}: has no plan", folder.string()),
        "make one: lenticule farm plan SCENE --rig RIG --frames A:B -o FILM.lts --work DIR");
  return parse_plan(*text, file.string());
}

}  // namespace

std::optional<std::string> FolderFiles::read(const fs::path& file) const {
  std::error_code error;
  if (!fs::exists(file, error)) return std::nullopt;
  return read_text_file(file, kMostPlanBytes);
}

std::optional<FileFacts> FolderFiles::look(const fs::path& file) const {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) return std::nullopt;
  return FileFacts{.bytes = static_cast<uint64_t>(status.st_size),
                   .changed = seconds_of(status.st_mtim)};
}

const FolderFiles& WorkFolder::plain_files() {
  static const FolderFiles files;
  return files;
}

WorkFolder::WorkFolder(fs::path folder, const FolderFiles& files)
    : folder_(std::move(folder)),
      files_(files),
      plan_(read_plan(folder_, files_)),
      identity_(plan_.identity()) {}

std::optional<Plan> WorkFolder::plan_in(const fs::path& folder) {
  std::error_code error;
  if (!fs::exists(folder / kPlanFile, error)) return std::nullopt;
  return read_plan(folder, plain_files());
}

void WorkFolder::create(const fs::path& folder, const Plan& plan, const std::string& program) {
  if (const auto there = plan_in(folder)) {
    if (there->identity() == plan.identity() && there->output == plan.output) return;
    throw Error(ErrorKind::Input, fmt::format("{}: has the plan of another film", folder.string()),
                "use another folder, or remove this one");
  }
  const std::string commands = commands_text(plan, program, folder);
  try {
    for (const char* part : {"chunks", "reports", "predictors", "attempts", "failures"})
      fs::create_directories(folder / part);
  } catch (const fs::filesystem_error& error) {
    throw Error(ErrorKind::Failed,
                fmt::format("{}: cannot create: {}", folder.string(), error.code().message()));
  }
  write_text_file(folder / "commands.txt", commands);
  write_text_file(folder / kPlanFile, plan_to_json(plan));  // last: the folder is complete
}

fs::path WorkFolder::report_file(uint64_t chunk) const {
  return folder_ / "reports" / numbered(chunk, ".json");
}
fs::path WorkFolder::differing_report_file(uint64_t chunk) const {
  return folder_ / "reports" / numbered(chunk, ".differs.json");
}
fs::path WorkFolder::chunk_file(const ChunkReport& report) const {
  return folder_ / "chunks" / fmt::format("{:06}-{}.lts", report.chunk, report.digest);
}
fs::path WorkFolder::attempts_folder(uint64_t chunk) const {
  return folder_ / "attempts" / numbered(chunk, "");
}
fs::path WorkFolder::failure_file(uint64_t chunk) const {
  return folder_ / "failures" / numbered(chunk, ".json");
}
fs::path WorkFolder::predictors_file(uint64_t frame) const {
  return folder_ / "predictors" / numbered(frame, ".json");
}

std::optional<ChunkReport> WorkFolder::read_report(const fs::path& file, uint64_t chunk) const {
  try {
    const auto text = files_.read(file);
    if (!text) return std::nullopt;
    ChunkReport report = parse_chunk_report(*text, file.string());
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

std::optional<ChunkReport> WorkFolder::report(uint64_t chunk) const {
  return read_report(report_file(chunk), chunk);
}

std::optional<ChunkReport> WorkFolder::differing_report(uint64_t chunk) const {
  return read_report(differing_report_file(chunk), chunk);
}

std::optional<ChunkReport> WorkFolder::done(uint64_t chunk) const {
  auto found = report(chunk);
  if (!found) return std::nullopt;
  const auto file = files_.look(chunk_file(*found));
  return file && file->bytes == found->bytes ? found : std::nullopt;
}

void WorkFolder::forget(uint64_t chunk) const {
  std::error_code error;
  fs::remove(report_file(chunk), error);
}

std::optional<frames::PredictorTable> WorkFolder::predictors(uint64_t frame) const {
  const fs::path file = predictors_file(frame);
  try {
    const auto text = files_.read(file);
    if (!text) return std::nullopt;
    const json object = parse_json(*text, file.string());
    const JsonFields fields(object, file.string());
    const json& distances = fields.need("distances");
    if (!distances.is_array() || distances.size() > frames::kMaxPredictors) return std::nullopt;
    frames::PredictorTable table;
    for (const json& distance : distances) {
      if (!distance.is_number_unsigned() || distance.get<uint64_t>() > UINT32_MAX)
        return std::nullopt;
      table.distance[++table.count] = distance.get<uint32_t>();
    }
    const std::string checked = predictors_text(identity_, frame, distances);
    if (fields.text("digest") != frames::digest_of_text(checked) || !is_valid(table))
      return std::nullopt;
    return table;
  } catch (const Error&) {
    return std::nullopt;  // the frame is rendered again
  }
}

void WorkFolder::publish_predictors(uint64_t frame, const frames::PredictorTable& predictors,
                                    const fs::path& attempt) const {
  json distances = json::array();
  for (int i = 1; i <= predictors.count; ++i) distances.push_back(predictors.distance[i]);
  const std::string digest = frames::digest_of_text(predictors_text(identity_, frame, distances));
  const fs::path made = attempt / "predictors.json";
  write_text_file(made, json_text(json{{"distances", distances}, {"digest", digest}}) + "\n");
  move_file(made, predictors_file(frame));
}

bool WorkFolder::finish_chunk(const fs::path& attempt, const fs::path& file,
                              const ChunkReport& report) const {
  const auto there = done(report.chunk);
  // A file that is the same already stays: a process on another node may be reading it, and a
  // network file system takes a file away from its readers when another one is renamed to its name.
  if (there && there->digest == report.digest) return true;
  const bool differs = there.has_value();
  move_file(file, chunk_file(report));
  sync_folder_of(chunk_file(report));  // the report must not survive a power cut without the file
  const fs::path made = attempt / "report.json";
  write_text_file(made, chunk_report_to_json(report));
  move_file(made, differs ? differing_report_file(report.chunk) : report_file(report.chunk));
  return !differs;
}

void move_file(const fs::path& from, const fs::path& to) {
  if (std::rename(from.c_str(), to.c_str()) != 0)
    throw Error(ErrorKind::Failed,
                fmt::format("{}: cannot rename to {}: {}", from.string(), to.string(),
                            std::generic_category().message(errno)));
}

}  // namespace lenticule::farm
