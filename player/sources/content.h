// SPDX-License-Identifier: Apache-2.0
// Content is what a SOURCE means: woven frames or views, and how its pictures hold the views.
// identify() finds that out from flags, sidecar, headers and name, before a picture is played.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "frames/quilt.h"
#include "frames/views_input/content_name.h"
#include "frames/views_input/depth_views.h"
#include "player/sources/source_spec.h"

namespace lenticule::player {

struct Content {
  enum class Kind {
    Woven,      ///< pixels of a panel, shown unchanged; also frames that are generated here
    Quilt,      ///< also a container of views
    ViewFiles,  ///< one file per view
    Stereo,
    OwnDepth,     ///< depth in separate files
    DepthInside,  ///< depth in a part of the picture
    OtherRig,     ///< woven for another rig, to be separated into views
  };
  Kind kind = Kind::Woven;
  frames::QuiltLayout layout = {};  ///< layout of a quilt
  frames::StereoLayout stereo = {};
  std::vector<int> eyes = {};  ///< the video's streams of the left and the right eye, if it has two
  frames::DepthLayout depth = {};
  frames::DepthOptions depth_options = {};
  frames::ViewCrop crop = {};  ///< crop of the views; with depth, its zero plane moves the depth
  std::optional<double> aspect = std::nullopt;
  bool rightmost_first = false;
  std::string rig_toml = {};  ///< rig of a container that was woven for another rig
  SourceSpec source = {};
};

/// Checks what flags say by themselves. Throws Error(Usage).
void check_layout(const ContentFlags& flags);

/// Returns what the source means. Woven frames in a container match the rig with this fingerprint
/// (empty: any) or are, with --reweave, those of another rig. `patterns_are_views` is true for
/// `weave`, where 'view%02d.png' means views; all other commands take it for woven frames. Throws
/// Error(Usage) for flags that contradict each other or the kind, Error(Input) for a sidecar or
/// container that cannot be read and for a sidecar that contradicts the name.
[[nodiscard]] Content identify(const SourceSpec& source, const std::string& rig_fingerprint,
                               bool patterns_are_views = false);

/// Returns the remedy for pictures of this size that were taken for woven frames and do not fit the
/// rig's panel.
[[nodiscard]] const char* remedy_of_unwoven(const frames::FrameGeometry& size);

/// Throws Error(Input) for woven frames of another size than the rig's panel; `remedy` replaces
/// remedy_of_unwoven().
void require_size_of_panel(const std::string& name, const frames::FrameGeometry& size,
                           const frames::FrameGeometry& panel, const char* remedy = nullptr);

}  // namespace lenticule::player
