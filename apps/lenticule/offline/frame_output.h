// SPDX-License-Identifier: Apache-2.0
// Where rendered frames go: picture files, a sequence container, or the ring of a player.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "apps/lenticule/offline/scene_sequence.h"
#include "frames/frame.h"
#include "frames/rational.h"
#include "frames/sequence/sequence_info.h"
#include "optics/trim.h"

namespace lenticule::player {

enum class Delivery {
  Done,
  Interrupted,  ///< a signal arrived while waiting for a place
};

class FrameOutput {
 public:
  virtual ~FrameOutput() = default;
  /// True if this frame is there already, so that it need not be rendered again.
  [[nodiscard]] virtual bool has(uint64_t frame) const = 0;
  /// Throws Error(Failed) for a full disk and the like, Error(Device) when the player is gone for
  /// good.
  [[nodiscard]] virtual Delivery deliver(uint64_t frame, const frames::FrameView& pixels) = 0;
  /// Every frame of the range was delivered.
  virtual void finish() = 0;
};

struct OutputRequest {
  std::string target;  ///< pattern, file, FILE.lts or ring:SOCKET
  FrameRange range;
  frames::FrameGeometry geometry{};
  optics::RigIdentity rig{};  ///< empty for frames that are not woven, or for a rig nobody named
  frames::Rate rate{};
  double ring_timeout_seconds = 10.0;
  std::string rig_toml = {};   ///< kept in a container
  std::string made_from = {};  ///< as frames::SequenceInfo has it
  bool resume = false;         ///< has() is going to be asked: what is there is gone on with
  bool overwrite = false;      ///< whatever is there may be replaced
  /// What a container says of its frames; made from the above unless given.
  std::optional<frames::SequenceInfo> sequence = std::nullopt;
};

/// Checks that the target can be written before anything is rendered: Error(Usage) for a target
/// that makes no sense, Error(Failed) for a folder that cannot be written to, Error(Device) or
/// Error(Input) for a player that does not answer or refuses.
[[nodiscard]] std::unique_ptr<FrameOutput> open_output(const OutputRequest& request);

}  // namespace lenticule::player
