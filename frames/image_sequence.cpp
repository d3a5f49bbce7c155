// SPDX-License-Identifier: Apache-2.0
#include "frames/image_sequence.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "base/error.h"
#include "frames/image_io.h"

namespace lenticule::frames {

class ImageSequence::Files final : public FrameDecoding {
 public:
  Files(std::vector<std::filesystem::path> files, const ImageSequenceOptions& options)
      : files_(std::move(files)), options_(options), first_(header_of_first()) {
    if (options_.accept) options_.accept(first_);
  }

  [[nodiscard]] double pixel_aspect() const { return upright_pixel_aspect(first_); }

  [[nodiscard]] DecodedRounds rounds() const override {
    const FrameGeometry geometry = oriented_geometry(first_.geometry, first_.orientation);
    const uint64_t fit = options_.pool_bytes / geometry.frame_bytes();
    const auto most = static_cast<uint64_t>(std::max(options_.pool_frames, 2));
    return {.geometry = geometry,
            .rate = options_.rate,
            .last = files_.size(),
            .skipped = options_.first,
            .pool_frames = static_cast<int>(std::clamp<uint64_t>(fit, 2, most)),
            .decoder_threads = options_.decoder_threads};
  }

  std::string decode(int /*thread*/, uint64_t frame, uint64_t /*next*/, WovenFrame& to) override {
    read_woven_into(files_[frame], oriented_geometry(first_.geometry, first_.orientation), to,
                    options_.use);
    return {};
  }

 private:
  [[nodiscard]] PictureInfo header_of_first() const {
    if (files_.empty()) throw Error(ErrorKind::Input, "image sequence: no files");
    return probe_picture(files_.front(), options_.use);
  }

  std::vector<std::filesystem::path> files_;
  ImageSequenceOptions options_;
  PictureInfo first_;
};

std::vector<std::filesystem::path> list_frame_files(const std::string& source) {
  if (!FilePattern::looks_like_pattern(source)) return {source};
  const FilePattern pattern(source);
  const std::vector<uint64_t> numbers = pattern.existing_or_throw();
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
    : ImageSequence(std::make_unique<Files>(std::move(files), options)) {}

ImageSequence::ImageSequence(std::unique_ptr<Files> files)
    : DecodedSource("image sequence", std::move(files)),
      pixel_aspect_(static_cast<const Files&>(decoding()).pixel_aspect()) {}

}  // namespace lenticule::frames
