// SPDX-License-Identifier: Apache-2.0
// The container's codec and what it is compared with, one frame at a time, on one thread: for
// benchmarks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "frames/frame.h"

namespace lenticule::frames {

enum class TrialKind {
  Copy,       ///< the bytes as they are
  Zstd,       ///< zstd on each band
  RowAbove,   ///< the difference to the row above, then zstd
  Container,  ///< as a sequence container stores it
};

class CodecTrial {
 public:
  /// `level` is zstd's, of the two kinds that have one.
  explicit CodecTrial(TrialKind kind, int level = 0);
  ~CodecTrial();
  CodecTrial(CodecTrial&&) noexcept;
  CodecTrial& operator=(CodecTrial&&) noexcept;

  /// Compresses the frame in the container's bands and keeps the result; its size in bytes.
  size_t encode(const FrameView& frame);
  /// What encode() kept, into a frame of the same geometry. False only if the codec is broken.
  [[nodiscard]] bool decode(WovenFrame& to);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lenticule::frames
