// SPDX-License-Identifier: Apache-2.0
// The messages between lenticule and lenticule-pictures, each one packet of a socket. Both
// programs come from the same build; lenticule checks all values that it receives.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "frames/picture_codec.h"

namespace lenticule::frames::confined {

/// Descriptors of the decoder: the socket, and the memory that both processes share.
inline constexpr int kPictureSocket = 0;
inline constexpr int kPictureMemory = 3;

/// The memory has two halves, which carry rows of one picture alternately.
inline constexpr size_t kHalfBytes = size_t{4} << 20;
inline constexpr size_t kMemoryBytes = 2 * kHalfBytes;
/// Size of a texel of four floats, the largest decoded pixel.
inline constexpr size_t kLargestPixel = 4 * sizeof(float);
static_assert(kHalfBytes >= kLargestPixel * frames::kMaxImageSide);

/// Limit of the memory for decoding one picture, in addition to the memory of the idle decoder.
inline constexpr uint64_t kPictureMemoryLimit = uint64_t{1} << 30;
/// Limit of the file size; the file is held in the memory of kPictureMemoryLimit.
inline constexpr uint64_t kPictureFileLimit = uint64_t{768} << 20;

enum class PictureRequest : uint32_t { Probe, Decode, Continue, Stop };

/// PictureRequestMessage is a request. A Probe or a Decode carries the file's descriptor.
struct PictureRequestMessage {
  PictureRequest request = PictureRequest::Probe;
  PictureValues values = PictureValues::Codes;  ///< which values a Decode asks for
  uint64_t file_bytes = 0;
  std::array<char, 16> extension = {};  ///< extension of the file's name, zero-terminated
};

enum class PictureReply : uint32_t { Idle, Header, Rows, Done, Failed, Unusual };

/// PictureReplyMessage is a reply. A decoder that reads PNG and usual JPEGs only replies
/// Unusual to all other pictures.
/// After the Header of a Decode and after each Rows the decoder waits for Continue, or for Stop,
/// which makes it idle.
struct PictureReplyMessage {
  PictureReply reply = PictureReply::Idle;
  int32_t width = 0;
  int32_t height = 0;
  int32_t orientation = 1;
  uint32_t pixel_bytes = 3;
  uint32_t two_eyes = 0;
  double pixel_aspect = 1.0;
  int32_t first_row = 0;
  int32_t rows = 0;
  uint32_t half = 0;
  std::array<char, 512> cause = {};   ///< cause of a failure, zero-terminated
  std::array<char, 128> remedy = {};  ///< its remedy, zero-terminated
};

}  // namespace lenticule::frames::confined
