// SPDX-License-Identifier: Apache-2.0
// CodecTrial runs the container's codec, or one to compare it with, on one frame at a time on one
// thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "frames/frame.h"

namespace lenticule::lab {

enum class TrialKind {
  Copy,       ///< uncompressed bytes
  Zstd,       ///< zstd on each band
  RowAbove,   ///< difference to the row above, then zstd
  Container,  ///< the format of a sequence container
};

class CodecTrial {
 public:
  /// `level` is zstd's level, for the two kinds that use zstd; for a container the largest error.
  explicit CodecTrial(TrialKind kind, int level = 0);
  ~CodecTrial();
  CodecTrial(CodecTrial&&) noexcept;
  CodecTrial& operator=(CodecTrial&&) noexcept;

  /// Compresses the frame in the container's bands and keeps the result; returns its size in bytes.
  size_t encode(const frames::FrameView& frame);
  /// Decodes the result of encode() into a frame of the same geometry. Returns false only if the
  /// codec is faulty.
  [[nodiscard]] bool decode(frames::WovenFrame& to);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lenticule::lab
