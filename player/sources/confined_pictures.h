// SPDX-License-Identifier: Apache-2.0
// ConfinedPictures decodes picture files in separate processes (lenticule-pictures), so that
// a malicious or broken file can at most crash, block or take over such a process.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "frames/picture_codec.h"

namespace lenticule::player {

/// Limits for one picture. frames/pictures/picture_messages.h limits memory and file size.
struct PictureLimits {
  /// Processor time of the decoder, which does not depend on the load of the machine.
  std::chrono::milliseconds processor_time{15'000};
  std::chrono::milliseconds processor_time_per_megapixel{500};
  /// Timeout without progress.
  std::chrono::milliseconds silence{60'000};
};

/// Keeps idle decoders for the next picture, because starting one takes longer than decoding most
/// pictures. A decoder that failed within a picture is replaced. Errors name the file, and the
/// limit if one was reached. Thread safety: any thread.
class ConfinedPictures final : public frames::PictureFileReader {
 public:
  /// If `program` is empty, it is searched for when the first picture is read.
  explicit ConfinedPictures(const std::filesystem::path& program = {},
                            const PictureLimits& limits = {});
  /// Ends all decoders.
  ~ConfinedPictures() override;

  [[nodiscard]] frames::PictureInfo probe(const std::filesystem::path& file) const override;
  void read(const frames::EncodedPicture& picture, frames::PictureSink& sink,
            frames::PictureValues values = frames::PictureValues::Codes) const override;

  /// Returns the process ids of idle decoders.
  [[nodiscard]] std::vector<pid_t> idle() const;
  /// Returns the number of decoders started so far.
  [[nodiscard]] uint64_t started() const;

 private:
  class Pool;
  template <class Use>
  auto with_decoder(const frames::EncodedPicture& picture, Use&& use) const;

  std::unique_ptr<Pool> usual_;  ///< decoders of PNG and usual JPEGs, which start at once
  std::unique_ptr<Pool> all_;
};

}  // namespace lenticule::player
