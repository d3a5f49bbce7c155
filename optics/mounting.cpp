// SPDX-License-Identifier: Apache-2.0
#include "optics/mounting.h"

#include <algorithm>
#include <array>
#include <utility>

#include "base/error.h"

namespace lenticule::optics {
namespace {

struct NamedMounting {
  const char* name;
  Mounting mounting;
};

constexpr std::array<NamedMounting, 8> kMountings{{
    {"0", {}},
    {"90", {.swapped = true, .reversed_columns = true}},
    {"180", {.reversed_columns = true, .reversed_rows = true}},
    {"270", {.swapped = true, .reversed_rows = true}},
    {"mirrored", {.reversed_columns = true}},
    {"mirrored 90", {.swapped = true, .reversed_columns = true, .reversed_rows = true}},
    {"mirrored 180", {.reversed_rows = true}},
    {"mirrored 270", {.swapped = true}},
}};

}  // namespace

PixelPlace Mounting::seen_place(PixelPlace sent, PixelGrid seen) const {
  if (swapped) std::swap(sent.column, sent.row);
  return {reversed_columns ? seen.width - 1 - sent.column : sent.column,
          reversed_rows ? seen.height - 1 - sent.row : sent.row};
}

Mounting Mounting::inverse() const {
  return swapped ? Mounting{true, reversed_rows, reversed_columns} : *this;
}

Mounting combined(const Mounting& first, const Mounting& second) {
  Mounting both = first;
  if (second.swapped) {
    both.swapped = !both.swapped;
    std::swap(both.reversed_columns, both.reversed_rows);
  }
  both.reversed_columns = both.reversed_columns != second.reversed_columns;
  both.reversed_rows = both.reversed_rows != second.reversed_rows;
  return both;
}

Mounting mounting_named(std::string_view name) {
  const auto found = std::find_if(kMountings.begin(), kMountings.end(),
                                  [name](const auto& entry) { return name == entry.name; });
  if (found != kMountings.end()) return found->mounting;
  throw Error(ErrorKind::Input, "mounting '" + std::string(name) + "': not a known name",
              "use 0, 90, 180 or 270 (degrees clockwise), alone or after 'mirrored'");
}

std::string mounting_name(const Mounting& mounting) {
  const auto found =
      std::find_if(kMountings.begin(), kMountings.end(),
                   [&mounting](const auto& entry) { return mounting == entry.mounting; });
  LENTICULE_CHECK(found != kMountings.end());
  return found->name;
}

}  // namespace lenticule::optics
