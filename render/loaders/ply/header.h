// SPDX-License-Identifier: Apache-2.0
// Reads the header of a PLY file: the elements that follow it, and their properties.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace lenticule::render::ply {

enum class ValueType { Int8, Uint8, Int16, Uint16, Int32, Uint32, Float32, Float64 };

struct Property {
  std::string name;
  ValueType type = ValueType::Float32;
  bool is_list = false;
  ValueType count_type = ValueType::Uint8;  ///< type of the number of a list's values
};

struct ElementKind {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

enum class Encoding { Text, LittleEndian, BigEndian };

struct Header {
  Encoding encoding = Encoding::Text;
  std::vector<ElementKind> elements;
  std::string texture;  ///< file name, or empty
  size_t end = 0;       ///< position of the first byte after the header
};

/// Reads up to the line end_header. Throws Error(Input) "source:line: reason".
[[nodiscard]] Header read_header(std::string_view text, const std::string& source);

}  // namespace lenticule::render::ply
