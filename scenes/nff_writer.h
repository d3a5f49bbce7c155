// SPDX-License-Identifier: Apache-2.0
// NffWriter writes NFF text.
#pragma once

#include <string>
#include <string_view>

#include "scenes/elements.h"

namespace lenticule::scenes {

class NffWriter {
 public:
  /// Writes each line of `text` as a comment line.
  void comment(std::string_view text);
  void add(const View& view);
  void add(const Background& background);
  void add(const PointLight& light);
  void add(const Fill& fill);
  void add(const Sphere& sphere);
  void add(const Cone& cone);
  void add(const Polygon& polygon);

  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  void vector(Vec3 v);

  std::string text_;
};

/// Returns the number that a reader of the text gets for a number: with nine significant digits,
/// which exceeds single precision, and without a negative zero.
[[nodiscard]] double as_read_from_nff(double number);

}  // namespace lenticule::scenes
