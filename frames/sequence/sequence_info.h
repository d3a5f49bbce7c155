// SPDX-License-Identifier: Apache-2.0
// SequenceInfo holds the metadata of a sequence container, stored as JSON: docs/content/formats.md
// has the keys.
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
  Views,  ///< every frame is a grid of views, woven during playback
};

/// SequenceViews describes the tiles of views in a frame and the cameras of the views. Tile 0 is
/// the bottom-left one; the next tiles are to its right, then row by row upward, as in a quilt.
struct SequenceViews {
  int count = 0;
  int columns = 0;
  int rows = 0;
  bool rightmost_first = false;  ///< view 0 belongs to the rightmost camera
  double aspect = 0.0;           ///< width / height of a view as displayed
  double cone_degrees =
      0.0;             ///< angle between the outermost cameras, seen from the focus; 0 unknown
  double focus = 0.0;  ///< distance of the plane that appears on the panel; 0 unknown
  friend bool operator==(const SequenceViews&, const SequenceViews&) = default;
};

struct SequenceInfo {
  SequenceKind kind = SequenceKind::Woven;
  FrameGeometry geometry;
  Rate rate;
  uint64_t first_frame = 0;  ///< number of frame 0 in the numbering of the rendering
  /// Frames [loop_begin, loop_end) repeat; without loop_end up to the last frame.
  uint64_t loop_begin = 0;
  std::optional<uint64_t> loop_end;
  /// Fingerprint and whole file of the rig that a woven sequence was made for.
  std::string rig_fingerprint;
  std::string rig_toml;
  /// If the rig is trimmed: the fingerprint without the trim, and the trim. Empty otherwise.
  std::string rig_calibration;
  optics::Trim rig_trim;
  /// Scene or input that the frames were made from: its name and the folder's name. Empty: not
  /// stated.
  std::string made_from;
  std::optional<SequenceViews> views;  ///< set in a sequence of views
  std::string software;                ///< program that wrote the sequence
  friend bool operator==(const SequenceInfo&, const SequenceInfo&) = default;
};

inline constexpr size_t kMaxMetadataBytes = size_t{4} << 20;
inline constexpr int kMaxSequenceViews = 1024;

/// Return the members about the rig as one identity, and set them from one.
[[nodiscard]] optics::RigIdentity rig_of(const SequenceInfo& info);
void state_rig(SequenceInfo& info, const optics::RigIdentity& rig);

/// Returns the JSON of all members except the geometry, which the file's header contains.
[[nodiscard]] std::string sequence_info_to_json(const SequenceInfo& info);

/// Parses the metadata. Throws Error(Input) that begins with `source` for invalid JSON, missing
/// keys and values out of range. Ignores unknown keys: later versions may add some.
[[nodiscard]] SequenceInfo parse_sequence_info(std::string_view json, const FrameGeometry& geometry,
                                               const std::string& source);

}  // namespace lenticule::frames
