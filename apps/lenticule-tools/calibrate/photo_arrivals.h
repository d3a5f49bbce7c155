// SPDX-License-Identifier: Apache-2.0
// PhotoArrivals finds photographs that arrive in a folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <vector>

namespace lenticule::tools {

/// PhotoArrivals reports each photograph once, after its file has stopped growing. Hidden files,
/// which transfers use as temporary names, do not count.
///
/// Thread safety: one thread.
class PhotoArrivals {
 public:
  /// With `existing`, photographs that are in the folder already count as arriving. Throws
  /// Error(Input) if the folder cannot be read.
  explicit PhotoArrivals(std::filesystem::path folder, bool existing = false);

  /// Returns the photographs whose size has not changed since the previous call, in the order of
  /// their names. Throws Error(Input) if the folder cannot be read.
  [[nodiscard]] std::vector<std::filesystem::path> arrived();

 private:
  [[nodiscard]] std::map<std::filesystem::path, uintmax_t> sizes() const;

  std::filesystem::path folder_;
  std::set<std::filesystem::path> known_;
  std::map<std::filesystem::path, uintmax_t> growing_;
};

}  // namespace lenticule::tools
