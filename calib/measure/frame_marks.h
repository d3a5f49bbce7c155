// SPDX-License-Identifier: Apache-2.0
// Finds the marks in a camera's pictures and reads the number they show.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "calib/measure/grey.h"
#include "calib/measure/pattern.h"

namespace lenticule::calib {

enum class MarkState {
  Read,       ///< the number is there
  Unsettled,  ///< a cell is neither lit nor dark: the panel is between two pictures
  Lost,       ///< the cells look like nothing that was ever shown: covered, or the camera moved
};

struct MarkReading {
  MarkState state = MarkState::Lost;
  int mark = 0;
  double white = 0.0;  ///< light of the cell that is always lit: the gain of this picture
};

/// Which camera pixels belong to which cell. Immutable.
class MarkReader {
 public:
  /// From pictures of the dark panel with marks 0, 1 and 2 and of the white one. Empty if a cell
  /// cannot be found, or has too few pixels to be trusted.
  [[nodiscard]] static std::optional<MarkReader> find(const std::array<GreyPicture, 3>& dark_marks,
                                                      const GreyPicture& white);

  [[nodiscard]] MarkReading read(const GreyPicture& picture) const;
  /// Pixels of one cell, for drawing previews.
  [[nodiscard]] const std::vector<uint32_t>& pixels(int cell) const {
    return pixels_[static_cast<size_t>(cell)];
  }

 private:
  std::array<std::vector<uint32_t>, MarkCells::kCount> pixels_;
  std::array<double, MarkCells::kCount> dark_{};  ///< mean light of the cell when it is dark
  std::array<double, MarkCells::kCount> lit_{};
};

}  // namespace lenticule::calib
