// SPDX-License-Identifier: Apache-2.0
// Decodes picture files in processes of their own (lenticule-video pictures), which may crash, hang
// or be taken over by a file.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "frames/picture_codec.h"

namespace lenticule::player {

/// What one picture may cost. Memory and file size are limited in
/// frames/pictures/picture_messages.h.
struct PictureLimits {
  /// Processor time of the decoder, which does not depend on how busy the machine is.
  std::chrono::milliseconds processor_time{15'000};
  std::chrono::milliseconds processor_time_per_megapixel{500};
  /// Without any sign of life.
  std::chrono::milliseconds silence{60'000};
};

/// Keeps decoders that are idle for the next picture: starting one takes longer than decoding most
/// pictures. A decoder that failed in the middle of a picture is replaced. Every function is safe
/// from any thread. Errors name the file, and the limit where that was reached.
class ConfinedPictures final : public frames::PictureFileReader {
 public:
  /// An empty `program` is searched for when the first picture is read.
  explicit ConfinedPictures(std::filesystem::path program = {}, const PictureLimits& limits = {});
  /// Ends all decoders.
  ~ConfinedPictures() override;
  ConfinedPictures(const ConfinedPictures&) = delete;
  ConfinedPictures& operator=(const ConfinedPictures&) = delete;

  [[nodiscard]] frames::PictureInfo probe(const std::filesystem::path& file) const override;
  void read(const std::filesystem::path& file, frames::PictureSink& sink) const override;

  /// Starts a decoder without waiting for it, so that the first picture need not. Failures come up
  /// with the first picture.
  void prepare() const noexcept;

  /// Processes of idle decoders.
  [[nodiscard]] std::vector<pid_t> idle() const;
  /// Decoders that were started so far.
  [[nodiscard]] uint64_t started() const;

 private:
  class Pool;
  std::unique_ptr<Pool> pool_;
};

}  // namespace lenticule::player
