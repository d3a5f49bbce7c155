// SPDX-License-Identifier: Apache-2.0
#include "player/video_program.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>
#include <system_error>

#include "base/error.h"
#include "base/text.h"
#include "player/child_process.h"
#include "player/exit_code.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr const char* kName = "lenticule-video";
constexpr std::chrono::seconds kProbeLimit{30};

/// "lenticule-video: FILE: cause" without the program's name.
std::string first_line(const std::string& output) {
  constexpr std::string_view kPrefix = "lenticule-video: ";
  std::string line = escaped(output.substr(0, std::min(output.find('\n'), size_t{500})));
  if (line.starts_with(kPrefix)) line.erase(0, kPrefix.size());
  return line;
}

}  // namespace

fs::path find_video_program() {
  std::error_code error;
  const fs::path here = fs::read_symlink("/proc/self/exe", error).parent_path();
  for (const fs::path& folder : {here, here / "../libexec/lenticule"}) {
    const fs::path program = folder / kName;
    if (access(program.c_str(), X_OK) == 0) return program;
  }
  throw Error(ErrorKind::Failed, fmt::format("{}: not found beside lenticule", kName),
              "reinstall lenticule: video files are read and written by this part of it");
}

bool looks_like_video(const fs::path& file) {
  constexpr std::array<std::string_view, 17> kNames = {
      ".mkv", ".webm", ".mp4", ".m4v", ".mov", ".avi", ".nut",  ".ts", ".m2ts",
      ".mpg", ".mpeg", ".ogv", ".flv", ".mxf", ".wmv", ".apng", ".y4m"};
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kNames.begin(), kNames.end(), extension) != kNames.end();
}

std::vector<VideoStream> probe_video(const fs::path& file, const fs::path& program) {
  const std::string path = (program.empty() ? find_video_program() : program).string();
  const ChildResult result = run_child({path, "probe", "--", file.string()}, kProbeLimit);
  if (result.exit_code == kOk) return parse_video_probe(result.output, file.string());
  if (result.exit_code == kInput) throw Error(ErrorKind::Input, first_line(result.output));
  if (result.exit_code == kFailed) throw Error(ErrorKind::Failed, first_line(result.output));
  throw Error(ErrorKind::Input,
              fmt::format("{}: the program that looks at it {}", file.string(),
                          result.timed_out ? "does not come to an end" : "crashed"),
              "the file is broken; convert it anew");
}

}  // namespace lenticule::player
