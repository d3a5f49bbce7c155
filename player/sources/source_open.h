// SPDX-License-Identifier: Apache-2.0
// The SOURCE argument of `play` as a FrameSource. The only place that knows which kinds there are.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "display/test_card.h"
#include "frames/frame_source.h"
#include "player/sources/content_flags.h"
#include "player/sources/followed_rig.h"
#include "player/sources/frame_range.h"
#include "player/sources/live_trim.h"
#include "player/sources/rig_warnings.h"
#include "player/sources/source_names.h"

namespace lenticule::player {

struct SourceRequest {
  /// "ring:SOCKET", "dir/%05d.png", one picture, "FILE.lts", a video file, "card", "views", or
  /// what docs/content.md lists: quilts, stereo, depth, "views:view%02d.png"
  std::string text = {};
  /// How views lie in `content_of`, and in nothing else: the command line's words are not about
  /// what a list or somebody at the control socket names.
  ContentFlags content = {};
  std::string content_of = {};
  WeavingFlags weaving = {};
  frames::FrameGeometry panel = {};
  optics::RigIdentity identity = {};  ///< of the rig at the start; `trim` knows the present one
  std::string rig_name = {};          ///< for messages
  std::string rig_file = {};  ///< what is woven here is woven for it, and again when it changes
  std::shared_ptr<FollowedRig> rig = nullptr;  ///< that of the file, for all that is woven here
  int slots = 8;  ///< frames in memory: slots of the ring, or of the pool that pictures go to
  std::optional<FrameRange> frames = std::nullopt;  ///< of a pattern, container or video
  /// Where the first round begins, if the kind can: a hint, frames tell their numbers.
  uint64_t first_frame = 0;
  bool plays_again = false;                        ///< frames are kept for a loop where they fit
  display::CardText card = {};                     ///< what a test card says
  std::shared_ptr<const LiveTrim> trim = nullptr;  ///< the rig of "views"
  /// Told what is shown although it is not what the rig asks for. Null: not told.
  std::shared_ptr<RigWarnings> warnings = nullptr;
};

/// Views, woven here: whatever its rig becomes, it follows. Looks at sidecars and containers'
/// headers; what cannot be read is none.
[[nodiscard]] bool is_woven_here(const SourceRequest& request);

struct OpenedSource {
  std::unique_ptr<frames::FrameSource> source;
  /// To be asked after playing, as long as `source` is there: why the sequence could not be played
  /// again, or empty. Null for sources that always can.
  std::function<std::string()> loop_obstacle;
  /// What to do when nothing comes, or empty.
  std::string stall_hint;
};

/// Throws Error(Usage) for what cannot be played, Error(Input) for missing or broken pictures
/// and videos and for those of another size than the panel, Error(Device) or Error(Failed) for a
/// ring that cannot be had.
[[nodiscard]] OpenedSource open_source(const SourceRequest& request);

}  // namespace lenticule::player
