// SPDX-License-Identifier: Apache-2.0
// Which files of a reference are compared with which of a test.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace lenticule::player {

struct PicturePair {
  std::filesystem::path reference;
  std::filesystem::path test;
};

/// Two files; two patterns, which are paired by number; or two folders, whose pictures are paired
/// by name, in the order of the names. Throws Error(Usage) if the two are of different kinds,
/// Error(Input) if there is nothing, or more on the test's side than in the reference, or a folder
/// lacks a picture of the other.
[[nodiscard]] std::vector<PicturePair> picture_pairs(const std::string& reference,
                                                     const std::string& test);

}  // namespace lenticule::player
