// SPDX-License-Identifier: Apache-2.0
// The messages between lenticule and `lenticule-video pictures`, each one packet of a socket. Both
// programs are of one build; lenticule checks all that it takes over from the other.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "frames/image_io.h"

namespace lenticule::frames::confined {

/// Descriptors of the decoder: the socket, and memory that both processes see.
inline constexpr int kPictureSocket = 0;
inline constexpr int kPictureMemory = 3;

/// The memory is two halves, which take turns to carry rows of one picture.
inline constexpr size_t kHalfBytes = size_t{4} << 20;
inline constexpr size_t kMemoryBytes = 2 * kHalfBytes;
static_assert(kHalfBytes >= size_t{3} * frames::kMaxImageSide);

/// What decoding one picture may take beyond what the decoder needs when it is idle.
inline constexpr uint64_t kPictureMemoryLimit = uint64_t{1} << 30;
/// The file is held in that memory.
inline constexpr uint64_t kPictureFileLimit = uint64_t{768} << 20;

enum class PictureRequest : uint32_t { Probe, Decode, Continue, Stop };

/// A Probe or a Decode comes with the file's descriptor.
struct PictureRequestMessage {
  PictureRequest request = PictureRequest::Probe;
  uint64_t file_bytes = 0;
  std::array<char, 16> extension = {};  ///< of the file's name, ends with a zero
};

enum class PictureReply : uint32_t { Idle, Header, Rows, Done, Failed };

/// After a Header of a Decode and after each Rows the decoder waits for Continue, or for Stop,
/// after which it is idle.
struct PictureReplyMessage {
  PictureReply reply = PictureReply::Idle;
  int32_t width = 0;
  int32_t height = 0;
  int32_t orientation = 1;
  double pixel_aspect = 1.0;
  int32_t first_row = 0;
  int32_t rows = 0;
  uint32_t half = 0;
  std::array<char, 512> cause = {};  ///< of a failure, ends with a zero
};

}  // namespace lenticule::frames::confined
