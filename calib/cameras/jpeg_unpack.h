// SPDX-License-Identifier: Apache-2.0
// JpegDecoder decodes single JPEG pictures of a camera's stream. It is the sole wrapper of
// libjpeg-turbo in this module.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace lenticule::calib {

/// JpegDecoder is reused from picture to picture. Throws Error(Failed) if there is no memory for
/// it.
///
/// Thread safety: one thread.
class JpegDecoder {
 public:
  JpegDecoder();

  /// Returns full-range R'G'B' of a picture of exactly this size, three bytes per pixel without
  /// padding. Returns nothing for other bytes: not a JPEG, another size, truncated, damaged. Extra
  /// bytes between picture and end marker, which many cameras send, are accepted. Valid until the
  /// next call.
  [[nodiscard]] std::span<const uint8_t> decode(std::span<const uint8_t> bytes, int width,
                                                int height);

 private:
  struct Close {
    void operator()(void* handle) const noexcept;
  };

  [[nodiscard]] bool header_fits(std::span<const uint8_t> bytes, int width, int height);

  std::unique_ptr<void, Close> handle_;
  std::vector<uint8_t> rgb_;
};

}  // namespace lenticule::calib
