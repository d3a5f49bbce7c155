// SPDX-License-Identifier: Apache-2.0
// The parts of `lenticule bench models` that tests check: smaller copies of pictures, maps of FLIP
// in colours and contact sheets, and the names of models.
#pragma once

#include <filesystem>
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

// Finds the models of `lenticule bench models` and names them.

struct ModelFile {
  std::filesystem::path file;
  std::string name;  ///< path below the folder it was found in, or its last two parts; no extension
  std::string stem;  ///< begins the names of its pictures: different for every model
};

/// Returns the .glb and .gltf files among `places`: files, and folders with all their sub-folders,
/// each folder's files sorted by name. Throws Error(Input) for a place that does not exist, and if
/// there is no model at all.
[[nodiscard]] std::vector<ModelFile> find_models(const std::vector<std::string>& places);
}  // namespace lenticule::bench
