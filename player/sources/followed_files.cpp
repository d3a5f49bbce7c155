// SPDX-License-Identifier: Apache-2.0
#include "player/sources/followed_files.h"

#include "base/error.h"
#include "frames/image_io.h"
#include "frames/views_input/quilt_sidecar.h"

namespace lenticule::player {
namespace {

constexpr size_t kMostFiles = 256;

void add_marks_of_pattern(const std::string& text, std::vector<FileMark>& marks) {
  const frames::FilePattern pattern(text);
  const std::vector<uint64_t> numbers = pattern.existing();
  marks.push_back({.size = static_cast<int64_t>(numbers.size())});
  for (const uint64_t number : numbers) {
    if (marks.size() >= kMostFiles) return;
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

}  // namespace

std::vector<FileMark> marks_of_source(const SourceSpec& source) {
  std::vector<FileMark> marks;
  for (const std::string& file : source.files()) add_marks(file, marks);
  for (const std::string& file : {source.content.depth, source.content.from_rig})
    if (!file.empty()) add_marks(file, marks);
  return marks;
}

}  // namespace lenticule::player
