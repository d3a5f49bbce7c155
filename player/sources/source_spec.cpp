// SPDX-License-Identifier: Apache-2.0
#include "player/sources/source_spec.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/text.h"
#include "frames/sequence/sequence_reader.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kRingPrefix = "ring:";
constexpr std::string_view kViewFilesPrefix = "views:";
constexpr std::string_view kCode = "code";
constexpr std::string_view kCodePrefix = "code:";

bool is_video_name(const fs::path& file) {
  constexpr std::array<std::string_view, 18> kNames = {
      ".mkv", ".webm", ".mp4", ".m4v", ".mov", ".avi", ".nut",  ".ts",  ".m2ts",
      ".mpg", ".mpeg", ".ogv", ".flv", ".mxf", ".wmv", ".apng", ".gif", ".y4m"};
  const std::string extension = lower_case(file.extension().string());
  return std::find(kNames.begin(), kNames.end(), extension) != kNames.end();
}

SourceKind kind_of(const std::string& text) {
  if (text == "card") return SourceKind::Card;
  if (text == "black") return SourceKind::Black;
  if (text == "views") return SourceKind::RigViews;
  if (text == kCode || text.starts_with(kCodePrefix)) return SourceKind::Code;
  if (text.starts_with(kRingPrefix)) return SourceKind::Ring;
  if (text.starts_with(kViewFilesPrefix)) return SourceKind::ViewFiles;
  if (lower_case(text).ends_with(".toml") || text.ends_with('/')) return SourceKind::List;
  return kind_of_file(text);
}

}  // namespace

SourceKind kind_of_file(const fs::path& file) {
  if (frames::is_sequence_name(file)) return SourceKind::Sequence;
  return is_video_name(file) ? SourceKind::Video : SourceKind::Pictures;
}

SourceSpec parse_source(std::string text, ContentFlags content, const fs::path& folder) {
  SourceKind kind = kind_of(text);
  std::error_code ignored;
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

bool SourceSpec::has_pictures() const {
  return kind != SourceKind::List && !files().empty();
}

std::string SourceSpec::without_prefix() const {
  if (kind == SourceKind::Ring) return text.substr(kRingPrefix.size());
  if (kind == SourceKind::ViewFiles) return text.substr(kViewFilesPrefix.size());
  return text;
}

std::vector<std::string> SourceSpec::files() const {
  if (kind == SourceKind::Card || kind == SourceKind::Black || kind == SourceKind::RigViews ||
      kind == SourceKind::Code || kind == SourceKind::Ring)
    return {};
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

}  // namespace lenticule::player
