// SPDX-License-Identifier: Apache-2.0
// ContentFlags and WeavingFlags are the flags of play, weave and convert that state how views are
// laid out in a source and how they are woven.
#pragma once

#include <optional>
#include <string>

#include "frames/quilt.h"
#include "frames/views_input/depth_views.h"
#include "frames/weave.h"
#include "frames/weaving/crosstalk.h"
#include "optics/rig.h"

namespace lenticule::player {

/// Each flag overrides names and sidecars.
struct ContentFlags {
  std::string grid;
  int views = 0;
  std::optional<double> aspect;
  bool invert = false;
  std::string stereo;  ///< sbs, tb, hsbs, htb, none
  std::string depth;   ///< a file, pattern or video, or the half of the picture that holds depth
  std::string depth_range;
  bool invert_depth = false;
  std::string from_rig;
  bool reweave = false;

  [[nodiscard]] bool any() const;
  friend bool operator==(const ContentFlags&, const ContentFlags&) = default;
};

struct WeavingFlags {
  std::string filter;  ///< empty: the choice of frames::view_filter()
  std::string fit = "contain";
  std::string crosstalk;
};

/// Returns the weave options. Throws Error(Usage) for unknown values.
[[nodiscard]] frames::WeaveOptions weave_options(const WeavingFlags& flags);

/// Parses the value of --crosstalk: empty, "spot", or a percentage. Throws Error(Usage).
[[nodiscard]] std::optional<frames::Crosstalk> crosstalk_of(const std::string& text,
                                                            const optics::Rig& rig, int views);

/// Parses "8x6", columns by rows, into the layout. Throws Error(Usage).
void read_grid(const std::string& text, frames::QuiltLayout& layout);

/// Parses "-2:2" in percent of a view's width, or "-20px:20px": the disparities of the farthest and
/// the nearest depth. Throws Error(Usage).
void read_depth_range(const std::string& text, frames::DepthOptions& options);

}  // namespace lenticule::player
