// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/ply/values.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>

#include "base/error.h"
#include "render/loaders/text_reader.h"

namespace lenticule::render::ply {
namespace {

size_t bytes_of(ValueType type) {
  switch (type) {
    case ValueType::Int8:
    case ValueType::Uint8:
      return 1;
    case ValueType::Int16:
    case ValueType::Uint16:
      return 2;
    case ValueType::Int32:
    case ValueType::Uint32:
    case ValueType::Float32:
      return 4;
    case ValueType::Float64:
      break;
  }
  return 8;
}

template <class T>
double loaded(const std::array<uint8_t, 8>& bytes) {
  T value{};
  std::memcpy(&value, bytes.data(), sizeof value);
  return static_cast<double>(value);
}

}  // namespace

void Values::fail(const std::string& reason) const {
  throw Error(ErrorKind::Input,
              fmt::format("{}: {} {}: {}", source_, render::quoted(*element_), index_, reason));
}

double Values::next_word() {
  constexpr std::string_view kSpace = " \t\r\n";
  at_ = std::min(data_.find_first_not_of(kSpace, at_), data_.size());
  const size_t end = std::min(data_.find_first_of(kSpace, at_), data_.size());
  if (end == at_) fail("the file ends here");
  double value = 0.0;
  const char* first = data_.data() + at_;
  const char* const last = data_.data() + end;
  if (*first == '+') ++first;
  const auto [stop, error] = std::from_chars(first, last, value);
  if ((error != std::errc() && error != std::errc::result_out_of_range) || stop != last)
    fail(fmt::format("{} is no number", render::quoted(data_.substr(at_, end - at_))));
  at_ = end;
  return value;
}

double Values::next_binary(ValueType type) {
  const size_t size = bytes_of(type);
  if (left() < size) fail("the file ends here");
  std::array<uint8_t, 8> bytes{};
  std::memcpy(bytes.data(), data_.data() + at_, size);
  at_ += size;
  if ((encoding_ == Encoding::BigEndian) == (std::endian::native == std::endian::little))
    std::reverse(bytes.begin(), bytes.begin() + size);
  switch (type) {
    case ValueType::Int8:
      return loaded<int8_t>(bytes);
    case ValueType::Uint8:
      return loaded<uint8_t>(bytes);
    case ValueType::Int16:
      return loaded<int16_t>(bytes);
    case ValueType::Uint16:
      return loaded<uint16_t>(bytes);
    case ValueType::Int32:
      return loaded<int32_t>(bytes);
    case ValueType::Uint32:
      return loaded<uint32_t>(bytes);
    case ValueType::Float32:
      return loaded<float>(bytes);
    case ValueType::Float64:
      break;
  }
  return loaded<double>(bytes);
}

}  // namespace lenticule::render::ply
