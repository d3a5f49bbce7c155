// SPDX-License-Identifier: Apache-2.0
// open_source opens the SOURCE argument of `play` as a FrameSource.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "display/test_card.h"
#include "frames/frame_source.h"
#include "player/sources/followed_rig.h"
#include "player/sources/frame_range.h"
#include "player/sources/live_trim.h"
#include "player/sources/rig_warnings.h"
#include "player/sources/source_spec.h"

namespace lenticule::player {

/// WallPart is one panel of a wall that one player shows.
struct WallPart {
  std::string name;
  frames::FrameGeometry panel;   ///< size of its frames
  optics::RigIdentity identity;  ///< identity of its rig with the viewing line of the wall
  optics::Rig rig;
  display::CardText card;
};

struct SourceRequest {
  SourceSpec spec = {};
  WeavingFlags weaving = {};
  frames::FrameGeometry panel = {};  ///< size of the frames; of a wall, of all parts together
  /// The panels of a wall: each plays its own film, whose name optics::file_of_panel() makes of the
  /// name in `spec`. Empty for one panel.
  std::vector<WallPart> wall = {};
  /// Identity of the rig at the start; `trim` has the current one.
  optics::RigIdentity identity = {};
  std::string rig_name = {};  ///< name in messages
  std::string rig_file = {};  ///< sources that are woven here follow changes of this file
  /// Shared rig of that file, for all sources woven here.
  std::shared_ptr<FollowedRig> rig = nullptr;
  int slots = 8;  ///< frames in memory: slots of the ring or of the picture pool
  std::optional<FrameRange> frames = std::nullopt;  ///< frames of a pattern, container or video
  /// First frame of the first round. Kinds of source that cannot start there ignore it; frames
  /// carry their numbers.
  uint64_t first_frame = 0;
  bool video_hardware = true;                      ///< decodes videos in hardware where possible
  bool plays_again = false;                        ///< keeps frames for the next loop if they fit
  display::CardText card = {};                     ///< text of a test card
  std::shared_ptr<const LiveTrim> trim = nullptr;  ///< the rig of its own views
  /// Receives warnings about frames that do not match the rig; may be null.
  std::shared_ptr<RigWarnings> warnings = nullptr;
};

struct OpenedSource {
  std::unique_ptr<frames::FrameSource> source;
  /// Returns, after playing and while `source` exists, why the sequence could not be repeated;
  /// empty if it could. Null for sources that can always be repeated.
  std::function<std::string()> loop_obstacle;
  /// Advice if no frame arrives; may be empty.
  std::string stall_hint;
  /// The frames were woven before they came here, so that a trim does not change them.
  bool woven_elsewhere = false;
};

/// Opens the source. Throws Error(Usage) for a source that cannot be played, Error(Input) for
/// pictures and videos that are missing, broken or of another size than the panel, Error(Device) or
/// Error(Failed) for a ring that cannot be opened.
[[nodiscard]] OpenedSource open_source(const SourceRequest& request);

}  // namespace lenticule::player
