// SPDX-License-Identifier: Apache-2.0
#include "player/sources/video_program.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <deque>
#include <mutex>
#include <optional>
#include <string_view>
#include <system_error>

#include "base/error.h"
#include "base/exit_code.h"
#include "base/file_mark.h"
#include "base/text.h"
#include "player/process/child_process.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr const char* kName = "lenticule-video";
/// Starting the program on a busy machine may take most of it.
constexpr std::chrono::seconds kProbeLimit{60};

/// Returns the error that the program printed: "lenticule-video: FILE: cause", and a line with the
/// remedy.
Error reported_error(ErrorKind kind, std::string_view output) {
  const auto take_line = [&output](std::string_view prefix) {
    std::string_view line = output.substr(0, output.find('\n'));
    output.remove_prefix(std::min(output.size(), line.size() + 1));
    if (line.starts_with(prefix)) line.remove_prefix(prefix.size());
    return escaped(line.substr(0, 500));
  };
  const std::string what = take_line("lenticule-video: ");
  return {kind, what, take_line("  ")};
}

/// A cached probe. A video's streams are needed several times before it plays: to detect its
/// format, and to open it.
struct KnownStreams {
  FileMark file;
  std::string program;
  std::vector<VideoStream> streams;
};
constexpr size_t kMostKnown = 32;
std::mutex known_mutex;
std::deque<KnownStreams> known_streams;  ///< newest first

std::optional<std::vector<VideoStream>> remembered(const FileMark& file,
                                                   const std::string& program) {
  const std::lock_guard lock(known_mutex);
  for (const KnownStreams& one : known_streams)
    if (file == one.file && program == one.program) return one.streams;
  return std::nullopt;
}

void remember(const FileMark& file, const std::string& program,
              const std::vector<VideoStream>& streams) {
  const std::lock_guard lock(known_mutex);
  known_streams.push_front({file, program, streams});
  if (known_streams.size() > kMostKnown) known_streams.pop_back();
}

}  // namespace

fs::path find_video_program() {
  if (auto program = find_sibling_program(kName)) return *std::move(program);
  throw Error(ErrorKind::Failed, fmt::format("{} is not installed", kName),
              "install the package lenticule-media, which reads pictures and videos");
}

std::vector<VideoStream> probe_video(const fs::path& file, const fs::path& program) {
  const std::string path = (program.empty() ? find_video_program() : program).string();
  const FileMark mark = mark_of(file);
  if (const auto known = remembered(mark, path)) return *known;
  const ProgramRun result = run_child({path, "probe", "--", file.string()}, kProbeLimit);
  if (result.exit_code == kOk) {
    std::vector<VideoStream> streams = parse_video_probe(result.output, file.string());
    // A file that changed during the probe is probed again the next time.
    if (mark.there && mark_of(file) == mark) remember(mark, path, streams);
    return streams;
  }
  if (result.exit_code == kInput) throw reported_error(ErrorKind::Input, result.output);
  if (result.exit_code == kFailed) throw reported_error(ErrorKind::Failed, result.output);
  throw Error(ErrorKind::Input,
              fmt::format("{}: the program that examines it {}", file.string(),
                          result.timed_out ? "does not end" : "crashed"),
              "the file is broken; convert it again");
}

}  // namespace lenticule::player
