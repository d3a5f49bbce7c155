// SPDX-License-Identifier: Apache-2.0
// probe_video asks lenticule-video about a file. The program's output is not trusted: a video file
// may have taken over the process that wrote it.
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "frames/frame.h"
#include "frames/image_io.h"
#include "frames/rational.h"

namespace lenticule::player {

/// `Key` contains the marks of the files. Thread safety: any thread.
template <class Key, class Found>
class KnownFiles {
 public:
  [[nodiscard]] std::optional<Found> find(const Key& key) const {
    const std::lock_guard lock(mutex_);
    for (const auto& [known, found] : known_)
      if (known == key) return found;
    return std::nullopt;
  }
  void add(const Key& key, const Found& found) {
    const std::lock_guard lock(mutex_);
    known_.emplace_front(key, found);
    if (known_.size() > 1000) known_.pop_back();  // as many as a list may have items
  }

 private:
  mutable std::mutex mutex_;
  std::deque<std::pair<Key, Found>> known_;  ///< newest first
};

/// Layout of two eyes in a stream's frames, from the stream's tag.
struct VideoStereo {
  std::string layout;        ///< FFmpeg's name: "side by side", "top and bottom", ...
  bool right_first = false;  ///< the right eye's picture is the left or the upper one
  bool half = false;         ///< each picture is squeezed; if not, its pixels may be
};

struct VideoStream {
  int index = 0;
  frames::FrameGeometry geometry;    ///< size of a view, within the ring's limits
  int views = 1;                     ///< 2: a frame is delivered as two eyes side by side
  std::optional<frames::Rate> rate;  ///< rate at which its time stamps are followed
  double pixel_aspect = 1.0;         ///< width over height of a pixel
  /// Rotation of the frames; empty for angles other than quarter turns.
  std::optional<frames::Orientation> orientation = frames::Orientation::Upright;
  std::optional<VideoStereo> stereo;  ///< layout of two eyes from a tag
  std::string codec;                  ///< escaped, like all text here
  std::string pixel_format;           ///< FFmpeg's name
  std::string sampling;               ///< "rgb", "grey", "4:4:4", "4:2:0", ...
  bool exact = false;                 ///< every code arrives as stored
  bool full_chroma = false;           ///< RGB, grey or 4:4:4: subpixels keep their own colours
  std::string warning;                ///< what is lost when it is played, and the remedy; or empty
  std::string refusal;                ///< reason why it cannot be decoded; empty if it can
};

/// A stream of sound.
struct SoundStream {
  int index = 0;
  std::string codec;     ///< escaped, like all text here
  std::string language;  ///< the tag, as "ger" or "de"; may be empty
  std::optional<double> duration_s;
  std::string refusal;  ///< reason why it cannot be decoded; empty if it can
};

/// The contents of a file; either list may be empty.
struct VideoProbe {
  std::vector<VideoStream> pictures;
  std::vector<SoundStream> sound;
};

/// Parses a probe's report. Throws Error(Input) "source: cause" if it is malformed, and if a
/// stream's sizes or numbers are out of range.
[[nodiscard]] VideoProbe parse_video_probe(std::string_view text, const std::string& source);

/// A line that a decoder prints while it works.
struct VideoEvent {
  enum class Kind { Position, Broken, Clip, Decoder, Other };
  Kind kind = Kind::Other;
  uint64_t frame = 0;           ///< frame number in the file (Position)
  std::optional<int64_t> time;  ///< time stamp of that frame
  uint64_t broken = 0;          ///< frames and packets left out or faulty so far
  uint64_t missing = 0;         ///< frames that the file claims to have and lacks (Clip)
  uint64_t length = 0;          ///< periods of the rate that the clip lasts (Clip)
  std::string decoder;          ///< FFmpeg's name of the decoder in use (Decoder), escaped
  bool hardware = false;        ///< hardware decodes, not software
  std::string reason;           ///< cause why hardware is not used, or fails; escaped
};
/// Returns none if the line is not such an event. Never throws because of the line's contents.
[[nodiscard]] std::optional<VideoEvent> parse_video_event(std::string_view line);

/// The program's first argument: it refuses to work for a player of another version, whose package
/// was upgraded while it ran.
inline constexpr const char* kForThisVersion = "--for=" LENTICULE_VERSION;

/// Returns the program's path: beside this program, or in ../libexec/lenticule if installed. Throws
/// Error(Failed).
[[nodiscard]] std::filesystem::path find_video_program();

/// Runs `lenticule-video probe` for at most a minute, or returns the cached report if the file
/// is unchanged. Throws Error(Input) with the program's message if the file is not a video,
/// Error(Failed) if the program does not work. An empty `program` is searched for.
[[nodiscard]] std::vector<VideoStream> probe_video(const std::filesystem::path& file,
                                                   const std::filesystem::path& program = {});

/// Returns the file's streams of sound, as probe_video() does.
[[nodiscard]] std::vector<SoundStream> probe_sound(const std::filesystem::path& file,
                                                   const std::filesystem::path& program = {});

}  // namespace lenticule::player
