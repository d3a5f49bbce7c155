// SPDX-License-Identifier: Apache-2.0
// Finds the marks in a camera's pictures and reads the number they show.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "calib/measure/grey.h"
#include "calib/measure/pattern.h"
#include "optics/vec.h"

namespace lenticule::calib {

enum class MarkState {
  Read,       ///< the number is there
  Unsettled,  ///< a cell is neither lit nor dark: the panel is between two pictures
  Lost,       ///< the cells look like nothing that was ever shown: covered, or the camera moved
};

struct MarkReading {
  MarkState state = MarkState::Lost;
  int mark = 0;
  int code = kNoCode;  ///< kNoCode where there is none or a bit of it is neither lit nor dark
  double white = 0.0;  ///< light of the cell that is always lit: the gain of this picture
};

/// The codes that the first pictures show for their cells to be found: each cell is lit in others
/// of the three dark ones than any mark is.
inline constexpr std::array<int, 4> kFindingCodes = {0b111, 0b010, 0b100, 0b000};

/// Which camera pixels belong to which cell. Immutable.
class MarkReader {
 public:
  /// From pictures of the dark panel with marks 0, 1 and 2 and of the white one. Empty if a cell
  /// of the marks cannot be found, or has too few pixels to be trusted. Reads codes if their cells
  /// are found too.
  [[nodiscard]] static std::optional<MarkReader> find(const std::array<GreyPicture, 3>& dark_marks,
                                                      const GreyPicture& white);

  [[nodiscard]] bool reads_codes() const { return coded_; }

  [[nodiscard]] MarkReading read(const GreyPicture& picture) const;
  /// How far the picture's marks are from where they were found, camera pixels: least squares over
  /// the edges of the cell that is always lit, so good for a few pixels. Without light it is zero.
  [[nodiscard]] Vec2 moved(const GreyPicture& picture) const;

 private:
  /// A pixel at an edge and how its light changes with the place of the marks.
  struct EdgePixel {
    uint32_t pixel;
    float light;
    Vec2 slope;  ///< per camera pixel that the marks move
  };
  void find_edges(const GreyPicture& dark, const std::vector<uint32_t>& around);
  [[nodiscard]] double part_lit(const GreyPicture& picture, size_t cell, double gain) const;

  std::array<std::vector<uint32_t>, MarkCells::kMost> pixels_;
  std::array<double, MarkCells::kMost> dark_{};  ///< mean light of the cell when it is dark
  std::array<double, MarkCells::kMost> lit_{};
  std::vector<EdgePixel> edges_;
  bool coded_ = false;
};

}  // namespace lenticule::calib
