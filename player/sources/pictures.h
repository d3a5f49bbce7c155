// SPDX-License-Identifier: Apache-2.0
// open_pictures opens pictures of any size as a FrameSource: a picture, a pattern, a video, or a
// container. open_views combines them to sets of views, for every kind of content that consists of
// views: quilts, pictures and videos per view, stereo, depth, frames woven for other rigs.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "frames/frame_source.h"
#include "frames/views_input/view_input.h"
#include "player/sources/content.h"

namespace lenticule::player {

/// Options of reading pictures.
struct PictureOptions {
  std::optional<FrameRange> frames = std::nullopt;  ///< frames of a pattern, container or video
  /// First frame of the first round. Kinds of source that cannot start there ignore it.
  uint64_t first_frame = 0;
  int pool_frames = 3;
  int decoder_threads = 1;
  int drawing_threads = 1;           ///< threads that make views from depth
  const optics::Rig* rig = nullptr;  ///< rig to weave for, whose sheet limits depth
  bool plays_again = false;
  /// Views: accepts subsampled chroma and applies orientation tags.
  bool before_weaving = true;
  /// Size of woven frames: another size is refused before memory is allocated.
  std::optional<frames::FrameGeometry> size = std::nullopt;
  bool plays = false;                                  ///< applies the limits of playback
  std::optional<uint64_t> most_pixels = std::nullopt;  ///< limit; by default that of `plays`
  /// Decodes videos in hardware where a device can.
  bool hardware = false;
  std::optional<int> stream = std::nullopt;  ///< stream of a video; default: the first
  /// Returns the pictures, in place of files; may be null. Called once.
  std::function<std::unique_ptr<frames::FrameSource>()> pictures = nullptr;
};

/// Throws Error(Usage) and Error(Input) as the functions of the individual kinds do.
[[nodiscard]] std::unique_ptr<frames::FrameSource> open_pictures(const std::string& text,
                                                                 const PictureOptions& options);

/// Opens content that has views. Throws Error(Usage) and Error(Input) for inputs that are missing,
/// broken, of different sizes or lengths, or too large.
[[nodiscard]] std::unique_ptr<frames::ViewInput> open_views(const Content& content,
                                                            const PictureOptions& options);

/// Returns identify(). If that is woven frames, but views are wanted or headers tell that they are
/// not of the panel (none: of any), looks for two eyes in the pixels, of a film in the first
/// seconds. Says once for each file what it found. Throws as identify() and open_views().
[[nodiscard]] Content identify_by_pixels(const SourceSpec& source,
                                         const std::string& rig_fingerprint,
                                         const std::optional<frames::FrameGeometry>& panel,
                                         bool views_wanted = false,
                                         bool patterns_are_views = false);

/// Waits at most two minutes for the next set of views; returns false at the end, or if
/// interrupted. Throws Error(Input) with the input's error, Error(Failed) if none came.
[[nodiscard]] bool await_next(frames::ViewInput& input, const std::string& name);

/// Does so for the first set. Throws also if the input has no frame, or if interrupted.
void await_first(frames::ViewInput& input, const std::string& name);

/// Returns the damage in the whole input, which it reads to its end, as await_next() does; the set
/// of views in use must be the last one needed.
[[nodiscard]] frames::FrameDamage await_damage(frames::ViewInput& input);

/// Returns the number of decoding threads beside a player; one core is left to the player.
[[nodiscard]] int decoding_threads();
/// Returns the number of threads for a command that does nothing else meanwhile.
[[nodiscard]] int all_threads();

}  // namespace lenticule::player
