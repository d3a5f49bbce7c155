// SPDX-License-Identifier: Apache-2.0
// What a source is, by flags, sidecar and name, before any of its pictures is decoded.
#pragma once

#include <optional>
#include <string>

#include "frames/quilt.h"
#include "frames/views_input/content_name.h"
#include "player/sources/content_flags.h"

namespace lenticule::player {

struct ContentMeaning {
  enum class Kind {
    Woven,      ///< the pixels of a panel, to be shown as they are
    Quilt,      ///< also a container of views
    ViewFiles,  ///< one per view
    Stereo,
    OwnDepth,     ///< depth in files of its own
    DepthInside,  ///< in a half of the picture
    OtherRig,     ///< woven, but to be taken apart
  };
  Kind kind = Kind::Woven;
  frames::QuiltLayout layout = {};  ///< of a quilt
  frames::StereoLayout stereo = {};
  frames::DepthPlace depth = frames::DepthPlace::Right;
  frames::DepthOptions depth_options = {};
  std::optional<double> aspect = std::nullopt;
  bool rightmost_first = false;
  std::string rig_toml = {};  ///< of a container woven for another rig
};

struct MeaningRequest {
  std::string text = {};
  ContentFlags flags = {};
  /// `weave` takes 'view%02d.png' for views; everybody else for woven frames.
  bool patterns_are_views = false;
  /// Of the rig that woven frames may be for. Empty: of any.
  std::string rig_fingerprint = {};
};

/// Throws Error(Usage) for flags that contradict each other or the kind, Error(Input) for a sidecar
/// or a container that cannot be read and for a sidecar that contradicts the name.
[[nodiscard]] ContentMeaning meaning_of(const MeaningRequest& request);

}  // namespace lenticule::player
