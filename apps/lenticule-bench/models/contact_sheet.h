// SPDX-License-Identifier: Apache-2.0
// Pictures of compared models: smaller copies, maps of FLIP in colours, and contact sheets.
#pragma once

#include <string>
#include <vector>

#include "frames/frame.h"

namespace lenticule::bench {

/// Returns the picture with squares of factor x factor pixels averaged in linear light. Columns and
/// rows that do not fill a square are left out. Throws Error(Usage) if the factor is below 1 or no
/// square fits.
[[nodiscard]] frames::WovenFrame averaged(const frames::FrameView& picture, int factor);

/// Returns the values 0 to 1 of a map as colours from black over purple and orange to light yellow.
[[nodiscard]] frames::WovenFrame flip_picture(const std::vector<float>& map, int width, int height);

/// ContactEntry is one model of a sheet.
struct ContactEntry {
  std::string caption{};
  /// Squares of `pane_px`; an empty frame leaves its place grey.
  frames::WovenFrame ours{}, theirs{}, flip{};
};

/// Number of models on one sheet.
inline constexpr int kSheetColumns = 3;
inline constexpr int kSheetRows = 6;

/// Returns the entries from left to right and from top to bottom, each as ours | theirs | FLIP
/// below its caption.
[[nodiscard]] frames::WovenFrame contact_sheet(const std::vector<ContactEntry>& entries,
                                               int pane_px);

}  // namespace lenticule::bench
