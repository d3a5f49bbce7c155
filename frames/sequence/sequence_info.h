// SPDX-License-Identifier: Apache-2.0
// What a sequence container says about its frames. Stored as JSON: docs/formats.md has the keys.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "frames/frame.h"
#include "frames/rational.h"
#include "optics/trim.h"

namespace lenticule::frames {

enum class SequenceKind {
  Woven,  ///< the pixels of one panel, made for one rig
  Views,  ///< every frame is a grid of views, to be woven when it is played
};

/// How the views lie in a frame and which cameras took them. Tile 0 is the bottom-left one, the
/// next are to its right, then row by row upward, as in a quilt.
struct SequenceViews {
  int count = 0;
  int columns = 0;
  int rows = 0;
  bool rightmost_first = false;  ///< view 0 belongs to the rightmost camera
  double aspect = 0.0;           ///< width / height of a view as it is to be seen
  double cone_degrees = 0.0;     ///< between the outermost cameras, seen from the focus; 0 unknown
  double focus = 0.0;            ///< distance of the plane that lies on the glass; 0 unknown
  friend bool operator==(const SequenceViews&, const SequenceViews&) = default;
};

struct SequenceInfo {
  SequenceKind kind = SequenceKind::Woven;
  FrameGeometry geometry;
  Rate rate;
  uint64_t first_frame = 0;  ///< number that frame 0 has where it was rendered
  /// Frames [loop_begin, loop_end) repeat; everything from the first to the last unless stated.
  uint64_t loop_begin = 0;
  std::optional<uint64_t> loop_end;
  /// Of a woven sequence: the rig it was made for, and that rig's whole file.
  std::string rig_fingerprint;
  std::string rig_toml;
  /// Of a rig with a trim in it: the fingerprint without the trim, and the trim. Empty without.
  std::string rig_calibration;
  optics::Trim rig_trim;
  /// The scene or the input that the frames were made from: its name and the folder's. Empty:
  /// not stated.
  std::string made_from;
  std::optional<SequenceViews> views;  ///< of a sequence of views
  std::string software;                ///< what wrote it
  friend bool operator==(const SequenceInfo&, const SequenceInfo&) = default;
};

inline constexpr size_t kMaxMetadataBytes = size_t{4} << 20;
inline constexpr int kMaxSequenceViews = 1024;

/// The three members about the rig as one, and back.
[[nodiscard]] optics::RigIdentity rig_of(const SequenceInfo& info);
void state_rig(SequenceInfo& info, const optics::RigIdentity& rig);

/// All but the geometry, which the file's header has.
[[nodiscard]] std::string sequence_info_to_json(const SequenceInfo& info);

/// Throws Error(Input) that begins with `source` for what is no such JSON, for missing keys and for
/// values out of range. Unknown keys are ignored: later versions may add some.
[[nodiscard]] SequenceInfo parse_sequence_info(std::string_view json, const FrameGeometry& geometry,
                                               const std::string& source);

}  // namespace lenticule::frames
