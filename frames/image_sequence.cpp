// SPDX-License-Identifier: Apache-2.0
#include "frames/image_sequence.h"

#include <fmt/format.h>

#include <memory>
#include <utility>

#include "base/error.h"
#include "frames/image_io.h"

namespace lenticule::frames {
namespace {

class PictureFiles final : public FrameDecoding {
 public:
  PictureFiles(std::vector<std::filesystem::path> files, const ImageSequenceOptions& options)
      : files_(std::move(files)), options_(options) {
    if (files_.empty()) throw Error(ErrorKind::Input, "image sequence: no files");
  }

  [[nodiscard]] DecodedRounds rounds() const override {
    return {.geometry = probe_image(files_.front()),
            .rate = options_.rate,
            .last = files_.size(),
            .skipped = options_.first,
            .pool_frames = options_.pool_frames,
            .decoder_threads = options_.decoder_threads};
  }

  std::string decode(int /*thread*/, uint64_t frame, uint64_t /*next*/, WovenFrame& to) override {
    read_woven_into(files_[frame], to);
    return {};
  }

 private:
  std::vector<std::filesystem::path> files_;
  ImageSequenceOptions options_;
};

}  // namespace

std::vector<std::filesystem::path> list_frame_files(const std::string& source) {
  if (!FilePattern::looks_like_pattern(source)) return {source};
  const FilePattern pattern(source);
  const std::vector<uint64_t> numbers = pattern.existing();
  if (numbers.empty()) throw Error(ErrorKind::Input, fmt::format("{}: no such files", source));
  std::vector<std::filesystem::path> files;
  for (const uint64_t number : numbers) {
    const uint64_t expected = numbers.front() + files.size();
    if (number != expected)
      throw Error(ErrorKind::Input,
                  fmt::format("{}: missing between {} and {}", pattern.path(expected).string(),
                              pattern.path(numbers.front()).filename().string(),
                              pattern.path(numbers.back()).filename().string()));
    files.push_back(pattern.path(number));
  }
  return files;
}

ImageSequence::ImageSequence(std::vector<std::filesystem::path> files,
                             const ImageSequenceOptions& options)
    : DecodedSource("image sequence", std::make_unique<PictureFiles>(std::move(files), options)) {}

}  // namespace lenticule::frames
