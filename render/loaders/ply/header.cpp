// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/ply/header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

#include "base/error.h"
#include "render/loaders/text_reader.h"

namespace lenticule::render::ply {
namespace {

struct TypeName {
  std::string_view name;
  ValueType type;
};
constexpr std::array<TypeName, 16> kTypeNames{{{"char", ValueType::Int8},
                                               {"int8", ValueType::Int8},
                                               {"uchar", ValueType::Uint8},
                                               {"uint8", ValueType::Uint8},
                                               {"short", ValueType::Int16},
                                               {"int16", ValueType::Int16},
                                               {"ushort", ValueType::Uint16},
                                               {"uint16", ValueType::Uint16},
                                               {"int", ValueType::Int32},
                                               {"int32", ValueType::Int32},
                                               {"uint", ValueType::Uint32},
                                               {"uint32", ValueType::Uint32},
                                               {"float", ValueType::Float32},
                                               {"float32", ValueType::Float32},
                                               {"double", ValueType::Float64},
                                               {"float64", ValueType::Float64}}};

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  constexpr std::string_view kSpace = " \t\r";
  for (size_t at = line.find_first_not_of(kSpace); at != std::string_view::npos;) {
    const size_t end = std::min(line.find_first_of(kSpace, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(kSpace, end);
  }
  return words;
}

class HeaderReader {
 public:
  HeaderReader(std::string_view text, const std::string& source) : text_(text), source_(source) {}

  Header read() {
    if (words_of(next_line()) != std::vector<std::string_view>{"ply"}) fail("expected 'ply'");
    bool has_format = false;
    while (true) {
      const std::string_view line = next_line();
      const auto words = words_of(line);
      if (words.empty() || words[0] == "obj_info") continue;
      if (words[0] == "end_header") break;
      if (words[0] == "comment")
        take_comment(line, words);
      else if (words[0] == "format" && words.size() >= 2)
        has_format = take_format(words[1]);
      else if (words[0] == "element" && words.size() == 3)
        take_element(words);
      else if (words[0] == "property" && !header_.elements.empty())
        header_.elements.back().properties.push_back(property_of(words));
      else
        fail(fmt::format("unexpected {}", render::quoted(line)));
    }
    if (!has_format) fail("the header states no format");
    header_.end = at_;
    return std::move(header_);
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const {
    throw Error(ErrorKind::Input, fmt::format("{}:{}: {}", source_, line_, reason));
  }

  std::string_view next_line() {
    ++line_;
    size_t end = text_.find_first_of("\r\n", at_);
    if (end == std::string_view::npos) fail("the header does not end");
    const std::string_view line = text_.substr(at_, end - at_);
    if (text_[end] == '\r' && end + 1 < text_.size() && text_[end + 1] == '\n') ++end;
    at_ = end + 1;
    return line;
  }

  void take_comment(std::string_view line, const std::vector<std::string_view>& words) {
    constexpr std::string_view kTexture = "TextureFile";
    if (words.size() < 3 || words[1] != kTexture) return;
    const size_t name = line.find(words[2], line.find(kTexture) + kTexture.size());
    header_.texture = line.substr(name);
  }

  bool take_format(std::string_view name) {
    if (name == "ascii")
      header_.encoding = Encoding::Text;
    else if (name == "binary_little_endian")
      header_.encoding = Encoding::LittleEndian;
    else if (name == "binary_big_endian")
      header_.encoding = Encoding::BigEndian;
    else
      fail(fmt::format("unknown format {}", render::quoted(name)));
    return true;
  }

  void take_element(const std::vector<std::string_view>& words) {
    uint64_t count = 0;
    const auto [end, error] =
        std::from_chars(words[2].data(), words[2].data() + words[2].size(), count);
    if (error != std::errc() || end != words[2].data() + words[2].size())
      fail(fmt::format("{} is no number of elements", render::quoted(words[2])));
    header_.elements.push_back({std::string(words[1]), count, {}});
  }

  Property property_of(const std::vector<std::string_view>& words) const {
    if (words.size() == 5 && words[1] == "list")
      return {std::string(words[4]), type_named(words[3]), true, type_named(words[2])};
    if (words.size() != 3) fail("expected 'property TYPE NAME' or 'property list TYPE TYPE NAME'");
    return {std::string(words[2]), type_named(words[1])};
  }

  [[nodiscard]] ValueType type_named(std::string_view name) const {
    const auto* const found = std::ranges::find(kTypeNames, name, &TypeName::name);
    if (found == kTypeNames.end()) fail(fmt::format("unknown type {}", render::quoted(name)));
    return found->type;
  }

  std::string_view text_;
  const std::string& source_;
  Header header_;
  size_t at_ = 0;
  int line_ = 0;
};

}  // namespace

Header read_header(std::string_view text, const std::string& source) {
  return HeaderReader(text, source).read();
}

}  // namespace lenticule::render::ply
