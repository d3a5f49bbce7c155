// SPDX-License-Identifier: Apache-2.0
// Implements numbered file names: "dir/%05d.png".
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <system_error>

#include "base/error.h"
#include "base/numbers.h"
#include "frames/image_io.h"

namespace lenticule::frames {
namespace {

constexpr int kMaxDigits = 18;

[[noreturn]] void reject(const std::string& pattern, const char* cause) {
  throw Error(ErrorKind::Usage, fmt::format("pattern '{}': {}", pattern, cause),
              "write one %d or %05d in the file's name, for example out/%05d.png");
}

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// Conversion holds the length of "%d" or "%0Nd" at the start of `text` and its N (0 if absent).
struct Conversion {
  size_t length = 0;
  int digits = 0;
};
std::optional<Conversion> parse_conversion(std::string_view text) {
  size_t end = 1;
  if (end < text.size() && text[end] == '0') ++end;
  const size_t digits_begin = end;
  while (end < text.size() && is_digit(text[end])) ++end;
  if (end >= text.size() || text[end] != 'd' || end - digits_begin > 2) return std::nullopt;
  // A pattern without the zero would pad with blanks; "%0d" has no padding.
  if (end > digits_begin && text[1] != '0') return std::nullopt;
  const auto digits = number_from<int>(text.substr(digits_begin, end - digits_begin));
  return Conversion{end + 1, digits.value_or(0)};
}

}  // namespace

FilePattern::FilePattern(std::string pattern) : pattern_(std::move(pattern)) {
  const size_t percent = pattern_.find('%');
  if (percent == std::string::npos) reject(pattern_, "no %d");
  const auto conversion = parse_conversion(std::string_view(pattern_).substr(percent));
  if (!conversion) reject(pattern_, "neither %d nor %0Nd");
  if (conversion->digits > kMaxDigits) reject(pattern_, "too many digits");
  prefix_ = pattern_.substr(0, percent);
  suffix_ = pattern_.substr(percent + conversion->length);
  digits_ = conversion->digits;
  if (suffix_.find('%') != std::string::npos) reject(pattern_, "more than one %");
  if (suffix_.find('/') != std::string::npos)
    reject(pattern_, "the number is not in the file name");
}

std::filesystem::path FilePattern::path(uint64_t number) const {
  return fmt::format("{}{:0{}}{}", prefix_, number, digits_, suffix_);
}

bool FilePattern::looks_like_pattern(std::string_view text) {
  return text.find('%') != std::string_view::npos;
}

std::vector<FilePattern::Named> FilePattern::similar() const {
  const std::filesystem::path prefix(prefix_);
  const std::filesystem::path folder = prefix.has_parent_path() ? prefix.parent_path() : ".";
  const std::string stem = prefix.filename().string();

  std::vector<Named> found;
  std::error_code error;
  for (std::filesystem::directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.size() <= stem.size() + suffix_.size() || !name.starts_with(stem) ||
        !name.ends_with(suffix_))
      continue;
    const size_t digits = name.size() - stem.size() - suffix_.size();
    const auto number = number_from<uint64_t>(std::string_view(name).substr(stem.size(), digits));
    if (number) found.push_back({*number, digits});
  }
  return found;
}

std::vector<uint64_t> FilePattern::existing() const {
  std::vector<uint64_t> numbers;
  const auto printed = [this](uint64_t number) {
    return fmt::formatted_size("{:0{}}", number, digits_);
  };
  for (const Named& one : similar())
    // Excludes names such as "7.png", which "%05d.png" does not produce.
    if (printed(one.number) == one.digits) numbers.push_back(one.number);
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

std::vector<uint64_t> FilePattern::existing_or_throw() const {
  std::vector<uint64_t> numbers = existing();
  if (!numbers.empty()) return numbers;
  const std::vector<Named> others = similar();
  throw Error(ErrorKind::Input, fmt::format("{}: no such files", pattern_),
              others.empty()
                  ? "%05d stands for a number of five digits, %d for one of any length"
                  : fmt::format("there are files with {} digits: '{}%0{}d{}'",
                                others.front().digits, prefix_, others.front().digits, suffix_));
}

}  // namespace lenticule::frames
