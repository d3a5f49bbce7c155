// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/sequence_reader.h"

#include <fcntl.h>

#include <algorithm>
#include <limits>
#include <string>

#include "base/file.h"
#include "base/text.h"
#include "frames/sequence/file_bytes.h"

namespace lenticule::frames {

namespace {

uint64_t missing_at_end(const std::filesystem::path& file, const SequenceLayout& layout) {
  if (layout.has_every_frame || is_unfinished_name(file)) return 0;
  const uint64_t announced = layout.info.loop_end.value_or(0);
  return std::max<uint64_t>(announced, layout.frames.size() + 1) - layout.frames.size();
}

}  // namespace

bool is_sequence_name(const std::filesystem::path& file) {
  return lower_case(file.filename().string()).ends_with(".lts") || is_unfinished_name(file);
}

bool is_unfinished_name(const std::filesystem::path& file) {
  return file.filename().string().ends_with(".lts.part");
}

SequenceReader::SequenceReader(const std::filesystem::path& file)
    : fd_(open_regular_file(file, std::numeric_limits<uint64_t>::max()).descriptor),
      layout_(read_sequence_layout(fd_.get(), file.string())),
      missing_(missing_at_end(file, layout_)) {}

uint64_t SequenceReader::file_bytes() const {
  return size_of(fd_.get());
}

void SequenceReader::will_need(uint64_t frame) const noexcept {
  advise(frame, POSIX_FADV_WILLNEED);
}

void SequenceReader::done_with(uint64_t frame) const noexcept {
  advise(frame, POSIX_FADV_DONTNEED);
}

void SequenceReader::advise(uint64_t frame, int advice) const noexcept {
  const uint64_t begin = layout_.frames[frame];
  if (begin == 0) return;
  const bool last = frame + 1 == layout_.frames.size();
  const uint64_t end = last ? layout_.data_end : layout_.frames[frame + 1];
  if (end > begin)
    static_cast<void>(::posix_fadvise(fd_.get(), static_cast<off_t>(begin),
                                      static_cast<off_t>(end - begin), advice));
}

std::vector<uint64_t> SequenceReader::find_damaged(
    const std::function<bool(uint64_t frame)>& progress) const {
  FrameDecoder decoder = make_decoder();
  WovenFrame frame(geometry());
  std::vector<uint64_t> damaged;
  for (uint64_t number = 0; number < frame_count(); ++number) {
    if (!decoder.decode(number, frame.bytes())) damaged.push_back(number);
    if (progress && !progress(number)) break;
  }
  return damaged;
}

}  // namespace lenticule::frames
