// SPDX-License-Identifier: Apache-2.0
// SourceSpec is a SOURCE as the user names it, with the flags that describe it. parse_source is the
// only place that knows by which name a source is of which kind.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/file.h"
#include "frames/capture/capture_format.h"

namespace lenticule::player {

/// The kinds before ViewFiles name no files.
enum class SourceKind {
  Card,       ///< "card": a test card
  Black,      ///< "black": a black frame
  RigViews,   ///< "views": the rig's views, each showing its number
  Code,       ///< "code:TEXT": the QR code of a text
  Ring,       ///< "ring:SOCKET": frames of another process; "?size=WxH": size of its views
  Live,       ///< "v4l2:DEVICE", "v4l2:DEVICE,DEVICE": cameras and grabbers
  ViewFiles,  ///< "views:PATTERN", "views:A|B": a picture or a film per view
  List,       ///< "NAME.toml", ".m3u", ".json": a playlist; "FOLDER/", "FOLDER": its files
  Sequence,   ///< "NAME.lts", and "NAME.lts.part" while it is unfinished
  Video,      ///< "NAME.mkv" and the other names that lenticule-video reads
  Pictures,   ///< all other names: a picture, or a pattern such as "out/%05d.png"
};

/// The flags of play, weave and convert that state how views are laid out in a source. Each
/// overrides names and sidecars.
struct ContentFlags {
  std::string grid;
  int views = 0;
  std::optional<double> aspect;
  bool invert = false;
  std::string stereo;  ///< sbs, tb, hsbs, htb, none
  std::string depth;   ///< a file, pattern or video, or the half of the picture that holds depth
  std::string depth_range;
  std::string depth_distance;
  bool invert_depth = false;
  std::string zero_plane;
  std::optional<double> depth_budget;  ///< limit of depth, in depths of field of the sheet
  std::string from_rig;
  bool reweave = false;

  friend bool operator==(const ContentFlags&, const ContentFlags&) = default;
};

/// Keys of lists that state the layout of an item, as the flag of the same name does. `views`,
/// `aspect` and `depth_budget` are numbers.
inline constexpr std::pair<std::string_view, std::string ContentFlags::*> kLayoutTexts[] = {
    {"grid", &ContentFlags::grid},
    {"stereo", &ContentFlags::stereo},
    {"depth", &ContentFlags::depth},
    {"depth_range", &ContentFlags::depth_range},
    {"depth_distance", &ContentFlags::depth_distance},
    {"zero_plane", &ContentFlags::zero_plane},
    {"from_rig", &ContentFlags::from_rig}};
inline constexpr std::pair<std::string_view, bool ContentFlags::*> kLayoutSwitches[] = {
    {"invert", &ContentFlags::invert},
    {"invert_depth", &ContentFlags::invert_depth},
    {"reweave", &ContentFlags::reweave}};

/// The name decides the kind, unless it is that of a folder. identify() decides whether the
/// pictures of a file are woven frames or views.
struct SourceSpec {
  SourceKind kind = SourceKind::Pictures;
  /// The name as it was given; "code" for a code, whose text may be secret.
  std::string text = {};
  std::string coded = {};     ///< text of a code
  ContentFlags content = {};  ///< flags or keys that were given with the source

  /// Returns true for a source whose pictures are in files.
  [[nodiscard]] bool has_pictures() const;
  /// Returns true for a source whose layout of views flags can state.
  [[nodiscard]] bool takes_layout() const {
    return has_pictures() || kind == SourceKind::Live || kind == SourceKind::Ring;
  }
  /// Returns true for animations, of which only the end tells whether they have several frames.
  [[nodiscard]] bool may_be_still() const;
  /// Returns the text after "ring:" and before "?", or after "views:", otherwise the whole text.
  [[nodiscard]] std::string without_prefix() const;
  /// Returns the files and patterns that the text names: several for "views:A|B", none for a source
  /// that is not in files.
  [[nodiscard]] std::vector<std::string> files() const;
  /// Returns the same source, as seen from elsewhere: its relative files are resolved against
  /// `folder`.
  [[nodiscard]] SourceSpec in_folder(const std::filesystem::path& folder) const;

  friend bool operator==(const SourceSpec&, const SourceSpec&) = default;
};

/// Parses a source's name. A name in `folder` (empty: the current one) that is a folder's gets the
/// slash that it lacks.
[[nodiscard]] SourceSpec parse_source(std::string text, ContentFlags content = {},
                                      const std::filesystem::path& folder = {});

/// The most cameras of one source.
inline constexpr size_t kMostCameras = 16;

struct CaptureSpec {
  std::vector<std::string> devices;
  frames::capture::FormatRequest request;
};

/// Parses "v4l2:/dev/video0,/dev/video2?size=1920x1080&format=MJPG&rate=60". Throws Error(Usage).
[[nodiscard]] CaptureSpec parse_capture(const std::string& text);

/// Returns true for a name that ends in .m3u or .m3u8, in any case.
[[nodiscard]] bool is_m3u_name(const std::string& file);
/// Returns true for a name that ends in .json, in any case.
[[nodiscard]] bool is_json_name(const std::string& file);
/// Returns Sequence, Video or Pictures (also for a still GIF), for a file or pattern in a source.
[[nodiscard]] SourceKind kind_of_file(const std::filesystem::path& file);

/// Returns the state of every file of a source and its sidecar; for a pattern, of the first 256
/// files, and their number. Empty for rings and for sources generated here. Costs one stat() per
/// file.
[[nodiscard]] std::vector<FileMark> marks_of_source(const SourceSpec& source);

/// Frame numbers [begin, end) of a sequence.
struct FrameRange {
  uint64_t begin = 0;
  uint64_t end = 1;
  [[nodiscard]] uint64_t count() const { return end - begin; }
  /// Returns the part of the range that lies before a frame: 0 for the first, below 1 for the last.
  [[nodiscard]] double part_before(uint64_t frame) const {
    return static_cast<double>(frame - begin) / static_cast<double>(count());
  }
  friend bool operator==(const FrameRange&, const FrameRange&) = default;
};

/// Parses "A:B", or "N" for one frame. Throws Error(Usage).
[[nodiscard]] FrameRange parse_frame_range(std::string_view text);

}  // namespace lenticule::player
