// SPDX-License-Identifier: Apache-2.0
// open_source opens a SOURCE of `play` as a FrameSource: the name is parsed to a SourceSpec,
// identify() finds out what it means, and the OpenContext states for which panel it is opened.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "display/test_card.h"
#include "frames/frame_source.h"
#include "player/sources/live_rig.h"
#include "player/sources/source_spec.h"
#include "player/sources/weaving_source.h"

namespace lenticule::player {

/// RigWarnings collects the player's warnings about frames that are shown although they were woven
/// before the rig was trimmed. It prints each warning once. Thread safety: any thread.
class RigWarnings {
 public:
  void add(const std::string& warning);
  [[nodiscard]] std::vector<std::string> all() const;

 private:
  mutable std::mutex mutex_;  ///< guards warnings_
  std::vector<std::string> warnings_;
};

/// WallPart is one panel of a wall that one player shows.
struct WallPart {
  std::string name;
  frames::FrameGeometry panel;   ///< size of its frames
  optics::RigIdentity identity;  ///< identity of its rig with the viewing line of the wall
  optics::Rig rig;
  display::CardText card;
};

/// OpenContext is all that opening a source depends on, beside the source.
struct OpenContext {
  frames::FrameGeometry panel = {};  ///< size of the frames; of a wall, of all parts together
  /// The panels of a wall: each plays its own film, whose name optics::file_of_panel() makes of the
  /// source's name. Empty for one panel.
  std::vector<WallPart> wall = {};
  std::shared_ptr<LiveRig> rig = nullptr;  ///< null for a wall, whose rigs are read once
  optics::RigIdentity identity = {};       ///< identity of the rig if `rig` is null
  std::string rig_name = {};               ///< name in messages
  /// Receives warnings about frames that do not match the rig; may be null.
  std::shared_ptr<RigWarnings> warnings = nullptr;
  WeavingFlags weaving = {};
  display::CardText card = {};  ///< text of a test card
  int slots = 8;                ///< frames in memory: slots of the ring or of the picture pool
  bool video_hardware = true;   ///< decodes videos in hardware where possible
  // The members below differ from item to item of a list.
  std::optional<FrameRange> frames = std::nullopt;  ///< frames of a pattern, container or video
  /// First frame of the first round. Kinds of source that cannot start there ignore it; frames
  /// carry their numbers.
  uint64_t first_frame = 0;
  bool plays_again = false;  ///< keeps frames for the next loop if they fit

  /// Returns the sizes of the pictures of a frame: one, or one for each panel of a wall.
  [[nodiscard]] std::vector<frames::FrameGeometry> pictures() const {
    std::vector<frames::FrameGeometry> sizes;
    for (const WallPart& part : wall) sizes.push_back(part.panel);
    return sizes.empty() ? std::vector{panel} : sizes;
  }
};

struct OpenedSource {
  std::unique_ptr<frames::FrameSource> source = nullptr;
  /// Returns, after playing and while `source` exists, why the sequence could not be repeated;
  /// empty if it could. Null for sources that can always be repeated.
  std::function<std::string()> loop_obstacle = nullptr;
  /// Advice if no frame arrives; may be empty.
  std::string stall_hint = {};
  /// Called with the number that the item's frames will have, and the rounds to play, as known at
  /// the start of each; may be null. Owns the sound.
  std::function<void(uint64_t item, uint64_t rounds)> begin_sound = nullptr;
  /// Statistics of pictures that come in live; null for other sources.
  std::shared_ptr<CaptureStatistics> live = nullptr;
  /// The frames were woven before they came here, so that a trim does not change them.
  bool woven_elsewhere = false;
};

/// Opens the source. Throws Error(Usage) for a source that cannot be played, Error(Input) for
/// pictures and videos that are missing, broken or of another size than the panel, Error(Device) or
/// Error(Failed) for a ring that cannot be opened.
[[nodiscard]] OpenedSource open_source(const SourceSpec& source, const OpenContext& context);

}  // namespace lenticule::player
