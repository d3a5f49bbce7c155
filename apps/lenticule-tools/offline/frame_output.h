// SPDX-License-Identifier: Apache-2.0
// FrameOutput is the destination of rendered frames: picture files, a sequence container, or the
// ring of a player.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "frames/frame.h"
#include "frames/rational.h"
#include "frames/sequence/sequence_info.h"
#include "optics/trim.h"

namespace lenticule::tools {

enum class Delivery {
  Done,
  Interrupted,  ///< a signal arrived while waiting for a free slot
};

class FrameOutput {
 public:
  virtual ~FrameOutput() = default;
  /// Returns true if this frame exists already and need not be rendered again.
  [[nodiscard]] virtual bool has(uint64_t frame) const = 0;
  /// Delivers a frame. Throws Error(Failed) for errors such as a full disk, Error(Device) if the
  /// player is gone permanently.
  [[nodiscard]] virtual Delivery deliver(uint64_t frame, const frames::FrameView& pixels) = 0;
  /// Completes the output after every frame of the range was delivered.
  virtual void finish() = 0;
};

struct OutputRequest {
  std::string target;  ///< pattern, file, FILE.lts or ring:SOCKET
  player::FrameRange range;
  frames::FrameGeometry geometry{};
  optics::RigIdentity rig{};  ///< empty for frames that are not woven, or without a rig
  frames::Rate rate{};
  double ring_timeout_seconds = 10.0;
  std::string rig_toml = {};   ///< stored in a container
  std::string made_from = {};  ///< see frames::SequenceInfo
  bool resume = false;         ///< continue an existing output; has() will be called
  bool overwrite = false;      ///< existing files may be replaced
  /// Metadata of a container; made from the members above if none.
  std::optional<frames::SequenceInfo> sequence = std::nullopt;
};

/// Checks, before rendering, that the target can be written, and opens it. Throws Error(Usage) for
/// an invalid target, Error(Failed) for a folder that is not writable, Error(Device) or
/// Error(Input) for a player that does not answer or refuses.
[[nodiscard]] std::unique_ptr<FrameOutput> open_output(const OutputRequest& request);

}  // namespace lenticule::tools
