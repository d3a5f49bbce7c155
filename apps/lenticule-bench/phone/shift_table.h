// SPDX-License-Identifier: Apache-2.0
// ShiftTable keeps where rays through a lens arrive, so that not every sample of a photograph needs
// a ray of its own through the lens sheet.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "apps/lenticule-bench/phone/lens_section.h"

namespace lenticule::bench {

/// ShiftTable holds, for directions in steps, where rays of all places under a lens arrive relative
/// to the ray through the apex. A valley has a NaN.
///
/// Thread safety: one thread, because tables are traced when they are first used. Lifetime: must
/// not outlive the sheet.
class ShiftTable {
 public:
  static constexpr int kPlaces = 256;  ///< number of places under a lens

  /// Shift between two points of the pixels, in panel pixels.
  struct Offset {
    float x = 0.0F, y = 0.0F;
  };
  using Table = std::array<Offset, kPlaces>;

  explicit ShiftTable(const LensSection& sheet);

  /// Interpolates the table of a direction.
  void evaluate(double tan_across, double tan_along, int channel, Table& out);

 private:
  static constexpr int kSteps = 120;
  static constexpr double kStep = 0.02;

  const Table& table(int i, int j, int channel);
  [[nodiscard]] Table trace(double tan_across, double tan_along, int channel) const;

  const LensSection& sheet_;
  std::vector<std::optional<Table>> values_;
};

}  // namespace lenticule::bench
