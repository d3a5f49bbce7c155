// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/text_reader.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "render/loaders/formats.h"

namespace lenticule::render {
namespace {

bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

}  // namespace

void refuse(const std::string& source, const std::string& reason) {
  throw input_error("{}: {}", source, reason);
}

std::optional<double> parse_number(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  return number_from<double>(word);
}

bool is_one_of(std::string_view list, std::string_view word) {
  return list.find(fmt::format(" {} ", word)) != std::string_view::npos;
}

std::string quoted(std::string_view word) {
  constexpr size_t kShown = 32;
  std::string out = "'";
  for (const char c : word.substr(0, kShown)) out += c >= ' ' && c < 127 ? c : '?';
  return out + (word.size() > kShown ? "...'" : "'");
}

TextReader::TextReader(std::string_view text, std::string source, std::string remedy)
    : text_(text), source_(std::move(source)), remedy_(std::move(remedy)) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text_.starts_with(kByteOrderMark)) text_.remove_prefix(kByteOrderMark.size());
}

/// Returns true for a line feed, or for a single carriage return as in old files.
bool TextReader::ends_line(size_t position) const {
  if (text_[position] == '\n') return true;
  const bool fed = position + 1 < text_.size() && text_[position + 1] == '\n';
  return text_[position] == '\r' && !fed;
}

bool TextReader::is_continued(size_t position) const {
  return text_[position] == '\\' && position + 1 < text_.size() &&
         (text_[position + 1] == '\n' || text_[position + 1] == '\r');
}

void TextReader::skip_space() {
  while (position_ < text_.size()) {
    const char c = text_[position_];
    if (c == '#') {
      position_ = std::min(text_.find_first_of("\r\n", position_), text_.size());
      continue;
    }
    if (is_continued(position_)) {
      position_ += text_.substr(position_ + 1, 2) == "\r\n" ? 3 : 2;
      if (line_ == scan_line_++) ++line_;
      continue;
    }
    if (!is_space(c)) return;
    if (ends_line(position_)) ++scan_line_;
    ++position_;
  }
}

std::optional<std::string_view> TextReader::word() {
  skip_space();
  if (position_ == text_.size()) return std::nullopt;
  const size_t begin = position_;
  while (position_ < text_.size() && !is_space(text_[position_]) && text_[position_] != '#' &&
         !is_continued(position_))
    ++position_;
  line_ = scan_line_;
  return text_.substr(begin, position_ - begin);
}

double TextReader::number(const char* what) {
  const auto text = word();
  if (!text) fail(fmt::format("the file ends before {}", what));
  const auto value = parse_number(*text);
  if (!value && text->find(',') != std::string_view::npos)
    fail(fmt::format("{} must have a decimal point, not the comma of {}", what, quoted(*text)),
         "export it again with decimal points, or replace the commas by points");
  if (!value) fail(fmt::format("{} must be a finite number, not {}", what, quoted(*text)));
  return *value;
}

double TextReader::number_in(const char* what, double low, double high) {
  const double value = number(what);
  if (value < low || value > high)
    fail(fmt::format("{} must lie in {:g}..{:g}, not {:g}", what, low, high, value));
  return value;
}

int TextReader::integer_in(const char* what, int low, int high) {
  const double value = number_in(what, low, high);
  if (value != std::floor(value)) fail(fmt::format("{} must be a whole number", what));
  return static_cast<int>(value);
}

Vec3 TextReader::vector_in(const char* what, double low, double high) {
  // The elements of a braced list are read in their order.
  return {number_in(what, low, high), number_in(what, low, high), number_in(what, low, high)};
}

Vec3 TextReader::point(const char* what) {
  return vector_in(what, -kMaxCoordinate, kMaxCoordinate);
}

Vec3 TextReader::colour(const char* what) {
  constexpr double kBrightest = 1e6;
  return vector_in(what, 0.0, kBrightest);
}

bool TextReader::number_follows() {
  skip_space();
  if (position_ == text_.size()) return false;
  const char c = text_[position_];
  return (c >= '0' && c <= '9') || c == '.' || c == '-' || c == '+';
}

bool TextReader::at_end() {
  skip_space();
  return position_ == text_.size();
}

bool TextReader::more_on_line() {
  skip_space();
  return position_ < text_.size() && scan_line_ == line_;
}

std::string_view TextReader::rest_of_line() {
  if (!more_on_line()) return {};
  const size_t end = std::min(text_.find_first_of("\r\n", position_), text_.size());
  std::string_view rest = text_.substr(position_, end - position_);
  position_ = end;
  while (is_space(rest.back())) rest.remove_suffix(1);
  return rest;
}

void TextReader::fail(const std::string& reason, const std::string& hint) const {
  fail_at(line_, reason, hint);
}

void TextReader::fail_at(int line, const std::string& reason, const std::string& hint) const {
  throw input_error("{}:{}: {}", source_, line, reason).remedy(hint.empty() ? remedy_ : hint);
}

void TextReader::require_at_most(size_t count, size_t most, const char* what) const {
  if (count > most) fail(fmt::format("more than {} {}", most, what), "divide the model");
}

}  // namespace lenticule::render
