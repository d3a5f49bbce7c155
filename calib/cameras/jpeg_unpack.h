// SPDX-License-Identifier: Apache-2.0
// One JPEG picture of a camera's stream. The only door to libjpeg-turbo.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace lenticule::calib {

/// Reused from picture to picture; one thread. Throws Error(Failed) if there is no memory for it.
class JpegDecoder {
 public:
  JpegDecoder();

  /// Full-range R'G'B' of a picture of exactly this size, three bytes a pixel without padding.
  /// Empty when the bytes are not that: garbage, another size, cut off, damaged inside. Bytes
  /// between picture and end marker, which many cameras send, do no harm. Valid until the next
  /// call.
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
