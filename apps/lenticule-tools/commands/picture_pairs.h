// SPDX-License-Identifier: Apache-2.0
// picture_pairs pairs the files of a reference with those of a test.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace lenticule::tools {

struct PicturePair {
  std::filesystem::path reference;
  std::filesystem::path test;
};

/// Pairs two files; or the files of two patterns by number; or the pictures of two folders by name,
/// sorted by name. Throws Error(Usage) if the two are of different kinds, Error(Input) if there are
/// no files, the test has files that the reference lacks, or a folder lacks a picture of the other.
[[nodiscard]] std::vector<PicturePair> picture_pairs(const std::string& reference,
                                                     const std::string& test);

}  // namespace lenticule::tools
