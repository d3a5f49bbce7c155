// SPDX-License-Identifier: Apache-2.0
// PropertyTable holds the properties of one KMS object, looked up by their exact names.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace lenticule::display {

struct Property {
  uint32_t id = 0;
  std::string name{};
  uint32_t flags = 0;  ///< DRM_MODE_PROP_*
  uint64_t value = 0;
  uint64_t minimum = 0;  ///< limits of ranges
  uint64_t maximum = 0;
  std::vector<std::pair<std::string, uint64_t>> enums{};  ///< bit numbers for bit masks

  [[nodiscard]] bool writable() const;
  [[nodiscard]] bool is_blob() const;
  [[nodiscard]] bool is_range() const;
  /// Returns the value (for bit masks: the mask) of the enumerator with this name.
  [[nodiscard]] std::optional<uint64_t> value_named(std::string_view enumerator) const;
  /// Returns text for people: the enumerator's name, "none"/"set" for blobs, the number otherwise.
  [[nodiscard]] std::string text_of(uint64_t of_value) const;
};

class PropertyTable {
 public:
  /// Reads the properties. `object_type` is a DRM_MODE_OBJECT_*. None if the object is gone.
  [[nodiscard]] static std::optional<PropertyTable> read(int fd, uint32_t object,
                                                         uint32_t object_type);

  [[nodiscard]] uint32_t object() const { return object_; }
  [[nodiscard]] const Property* find(std::string_view name) const;
  /// Returns the property's id. Throws Error(Device) if the driver lacks it.
  [[nodiscard]] uint32_t require(std::string_view name) const;
  /// Returns the property's value; 0 if there is no such property.
  [[nodiscard]] uint64_t value(std::string_view name) const;
  [[nodiscard]] const std::vector<Property>& all() const { return properties_; }

 private:
  uint32_t object_ = 0;
  std::vector<Property> properties_;
};

/// Returns the bytes of a blob; empty for id 0 and for blobs that are gone.
[[nodiscard]] std::vector<uint8_t> read_blob(int fd, uint32_t id);

}  // namespace lenticule::display
