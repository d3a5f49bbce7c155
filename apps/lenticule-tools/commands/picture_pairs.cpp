// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/commands/picture_pairs.h"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "base/error.h"
#include "frames/image_format.h"
#include "frames/image_io.h"

namespace lenticule::tools {
namespace {

std::vector<PicturePair> pairs_by_number(const std::string& reference_text,
                                         const std::string& test_text) {
  const frames::FilePattern reference(reference_text), test(test_text);
  const std::vector<uint64_t> numbers = reference.existing_or_throw();
  const std::vector<uint64_t> others = test.existing();
  if (others.size() > numbers.size())
    throw Error(
        ErrorKind::Input,
        fmt::format("{}: {} files, the reference has {}", test_text, others.size(), numbers.size()),
        "remove those that have no counterpart");
  std::vector<PicturePair> pairs;
  for (const uint64_t number : numbers)
    pairs.push_back({reference.path(number), test.path(number)});
  return pairs;
}

/// Returns names in sorted order, without hidden files and files that are not pictures.
std::vector<std::string> picture_names(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    const std::string extension = entry.path().extension().string();
    if (!name.starts_with('.') &&
        frames::format_of_extension(extension) != frames::ImageFormat::Unknown)
      names.push_back(name);
  }
  if (error) throw Error(ErrorKind::Input, fmt::format("{}: {}", folder.string(), error.message()));
  if (names.empty())
    throw Error(ErrorKind::Input, fmt::format("{}: no pictures", folder.string()),
                "name a folder of PNG, TIFF, EXR or PPM files");
  std::sort(names.begin(), names.end());
  return names;
}

std::vector<PicturePair> pairs_by_name(const std::filesystem::path& reference,
                                       const std::filesystem::path& test) {
  const std::vector<std::string> names = picture_names(reference);
  const std::vector<std::string> others = picture_names(test);
  const auto require = [](const std::vector<std::string>& wanted,
                          const std::vector<std::string>& there,
                          const std::filesystem::path& folder) {
    for (const std::string& name : wanted)
      if (!std::binary_search(there.begin(), there.end(), name))
        throw Error(ErrorKind::Input, fmt::format("{}: no such picture", (folder / name).string()),
                    "both folders need pictures with the same names");
  };
  require(names, others, test);
  require(others, names, reference);
  std::vector<PicturePair> pairs;
  for (const std::string& name : names) pairs.push_back({reference / name, test / name});
  return pairs;
}

}  // namespace

std::vector<PicturePair> picture_pairs(const std::string& reference, const std::string& test) {
  const bool pattern = frames::FilePattern::looks_like_pattern(reference);
  if (pattern != frames::FilePattern::looks_like_pattern(test))
    throw Error(ErrorKind::Usage, "compare: only one side is a pattern",
                "give two files, two folders, or two patterns like a/%05d.png b/%05d.png");
  if (pattern) return pairs_by_number(reference, test);
  const bool folder = std::filesystem::is_directory(reference);
  if (folder != std::filesystem::is_directory(test))
    throw Error(ErrorKind::Usage, "compare: only one side is a folder",
                "give two files, two folders, or two patterns like a/%05d.png b/%05d.png");
  if (folder) return pairs_by_name(reference, test);
  return {{reference, test}};
}

}  // namespace lenticule::tools
