// SPDX-License-Identifier: Apache-2.0
#include "player/sources/source_spec.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <system_error>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "base/text.h"
#include "frames/capture/pixel_layout.h"
#include "frames/image_format.h"
#include "frames/image_io.h"
#include "frames/sequence/sequence_reader.h"
#include "frames/views_input/content_name.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kRingPrefix = "ring:";
constexpr std::string_view kLivePrefix = "v4l2:";
constexpr std::string_view kViewFilesPrefix = "views:";
constexpr std::string_view kCode = "code";
constexpr std::string_view kCodePrefix = "code:";
constexpr size_t kMostMarks = 256;
constexpr uint64_t kMostFrames = 100'000'000;

bool is_video_name(const fs::path& file) {
  constexpr std::array<std::string_view, 18> kNames = {
      ".mkv", ".webm", ".mp4", ".m4v", ".mov", ".avi", ".nut",  ".ts",  ".m2ts",
      ".mpg", ".mpeg", ".ogv", ".flv", ".mxf", ".wmv", ".apng", ".gif", ".y4m"};
  const std::string extension = lower_case(file.extension().string());
  return std::find(kNames.begin(), kNames.end(), extension) != kNames.end();
}

/// Returns true for a GIF of a single picture.
bool is_still(const fs::path& file) try {
  constexpr uint64_t kMostBytes = 16 << 20;
  return lower_case(file.extension().string()) == ".gif" &&
         frames::detect_format(read_whole_file(file, kMostBytes), {}) == frames::ImageFormat::Gif;
} catch (const Error&) {
  return false;
}

SourceKind kind_of(const std::string& text) {
  if (text == "card") return SourceKind::Card;
  if (text == "black") return SourceKind::Black;
  if (text == "views") return SourceKind::RigViews;
  if (text == kCode || text.starts_with(kCodePrefix)) return SourceKind::Code;
  if (text.starts_with(kRingPrefix)) return SourceKind::Ring;
  if (text.starts_with(kLivePrefix)) return SourceKind::Live;
  if (text.starts_with(kViewFilesPrefix)) return SourceKind::ViewFiles;
  if (lower_case(text).ends_with(".toml") || is_m3u_name(text) || is_json_name(text) ||
      text.ends_with('/'))
    return SourceKind::List;
  return kind_of_file(text);
}

void add_marks_of_pattern(const std::string& text, std::vector<FileMark>& marks) {
  const frames::FilePattern pattern(text);
  const std::vector<uint64_t> numbers = pattern.existing();
  marks.push_back({.size = static_cast<int64_t>(numbers.size())});
  for (const uint64_t number : numbers) {
    if (marks.size() >= kMostMarks) return;
    marks.push_back(mark_of(pattern.path(number)));
  }
  if (!numbers.empty()) marks.push_back(mark_of(frames::sidecar_of(pattern.path(numbers.front()))));
}

void add_marks(const std::string& text, std::vector<FileMark>& marks) {
  if (!frames::FilePattern::looks_like_pattern(text)) {
    marks.push_back(mark_of(text));
    marks.push_back(mark_of(frames::sidecar_of(text)));
    return;
  }
  try {
    add_marks_of_pattern(text, marks);
  } catch (const Error&) {
    return;  // the number is in a folder's name: not followed
  }
}

std::optional<uint64_t> frame_number(std::string_view text) {
  const auto number = number_from<uint64_t>(text);
  return number.value_or(kMostFrames + 1) > kMostFrames ? std::nullopt : number;
}

constexpr double kUsualLiveRate = 60.0;

[[noreturn]] void refuse_live(const std::string& text, const std::string& what) {
  throw usage_error("source '{}': {}", text, what)
      .remedy(
          "for example v4l2:/dev/video0, v4l2:/dev/video0,/dev/video2 or "
          "'v4l2:/dev/video0?size=1920x1080&format=MJPG&rate=60'");
}

void read_option(const std::string& text, std::string_view option,
                 frames::capture::FormatRequest& request) {
  const std::string_view key = take_until(option, '=');
  if (key == "size") {
    const auto size = numbers_from<int, 2>(option, 'x');
    if (!size || (*size)[0] < 1 || (*size)[1] < 1 || (*size)[0] > frames::capture::kMaxSide ||
        (*size)[1] > frames::capture::kMaxSide)
      refuse_live(text, fmt::format("size '{}' is not a size such as 1920x1080", option));
    request.width = (*size)[0];
    request.height = (*size)[1];
  } else if (key == "format") {
    request.pixel_format = option;
    if (frames::capture::layout_named(request.pixel_format) == nullptr)
      refuse_live(text, fmt::format("format '{}' is not known", option));
  } else if (key == "rate") {
    const auto rate = number_from<double>(option);
    if (!rate || !(*rate >= 0.1 && *rate <= 1000.0))
      refuse_live(text, fmt::format("rate '{}' is not 0.1 to 1000", option));
    request.frames_per_second = *rate;
  } else {
    refuse_live(text, fmt::format("unknown option '{}'; there are size, format and rate", key));
  }
}

}  // namespace

bool is_m3u_name(const std::string& file) {
  const std::string extension = lower_case(fs::path(file).extension().string());
  return extension == ".m3u" || extension == ".m3u8";
}

bool is_json_name(const std::string& file) { return lower_case(file).ends_with(".json"); }

SourceKind kind_of_file(const fs::path& file) {
  if (frames::is_sequence_name(file)) return SourceKind::Sequence;
  return is_video_name(file) && !is_still(file) ? SourceKind::Video : SourceKind::Pictures;
}

SourceSpec parse_source(std::string text, ContentFlags content, const fs::path& folder) {
  SourceKind kind = kind_of(text);
  std::error_code ignored;
  if (kind == SourceKind::Video) kind = kind_of_file(folder / text);
  if (kind == SourceKind::Pictures && fs::is_directory(folder / text, ignored)) {
    text += '/';
    kind = SourceKind::List;
  }
  if (kind == SourceKind::Code)
    return {.kind = kind,
            .text = std::string(kCode),
            .coded = text.substr(std::min(text.size(), kCodePrefix.size())),
            .content = std::move(content)};
  return {.kind = kind, .text = std::move(text), .content = std::move(content)};
}

bool SourceSpec::has_pictures() const { return kind != SourceKind::List && !files().empty(); }

bool SourceSpec::may_be_still() const {
  const std::string name = lower_case(text);
  return name.ends_with(".gif") || name.ends_with(".apng");
}

std::string SourceSpec::without_prefix() const {
  if (kind == SourceKind::Ring)
    return text.substr(kRingPrefix.size(), text.find('?') - kRingPrefix.size());
  if (kind == SourceKind::ViewFiles) return text.substr(kViewFilesPrefix.size());
  return text;
}

std::vector<std::string> SourceSpec::files() const {
  if (kind < SourceKind::ViewFiles) return {};
  if (kind != SourceKind::ViewFiles) return {text};
  std::vector<std::string> files(1);
  for (const char c : without_prefix()) {
    if (c == '|')
      files.emplace_back();
    else
      files.back() += c;
  }
  return files;
}

SourceSpec SourceSpec::in_folder(const fs::path& folder) const {
  const std::vector<std::string> names = files();
  if (names.empty()) return *this;
  SourceSpec moved = *this;
  moved.text = kind == SourceKind::ViewFiles ? kViewFilesPrefix : std::string_view();
  for (const std::string& name : names) {
    if (&name != &names.front()) moved.text += '|';
    moved.text += fs::path(name).is_relative() ? (folder / name).string() : name;
  }
  return moved;
}

CaptureSpec parse_capture(const std::string& text) {
  std::string_view options(text);
  options.remove_prefix(std::min(options.size(), std::string_view("v4l2:").size()));
  std::string_view names = take_until(options, '?');
  CaptureSpec spec{.devices = {},
                   .request = {.frames_per_second = kUsualLiveRate, .for_display = true}};
  do {
    spec.devices.emplace_back(take_until(names, ','));
    if (spec.devices.back().empty()) refuse_live(text, "a device is missing");
  } while (!names.empty());
  if (spec.devices.size() > kMostCameras)
    refuse_live(text, fmt::format("more than {} devices", kMostCameras));
  while (!options.empty()) read_option(text, take_until(options, '&'), spec.request);
  return spec;
}

std::vector<FileMark> marks_of_source(const SourceSpec& source) {
  std::vector<FileMark> marks;
  for (const std::string& file : source.files()) add_marks(file, marks);
  for (const std::string& file : {source.content.depth, source.content.from_rig})
    if (!file.empty()) add_marks(file, marks);
  return marks;
}

FrameRange parse_frame_range(std::string_view text) {
  const size_t colon = text.find(':');
  const auto begin = frame_number(text.substr(0, colon));
  const bool single = colon == std::string_view::npos;
  const auto end = single && begin ? *begin + 1 : frame_number(text.substr(colon + 1));
  const bool numbers = begin && end;
  if (!numbers || *end <= *begin)
    throw usage_error("--frames '{}': {}", text,
                      numbers ? "contains no frame" : "not a range of frames")
        .remedy("for example --frames 0:24, which ends before frame 24");
  return {*begin, *end};
}

}  // namespace lenticule::player
