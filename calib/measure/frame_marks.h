// SPDX-License-Identifier: Apache-2.0
// MarkReader finds the marks in a camera's pictures and reads their number.
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
  Read,       ///< the number was read
  Unsettled,  ///< a cell is neither lit nor dark: the panel is between two pictures
  Lost,       ///< the cells match no mark: they are covered, or the camera moved
};

struct MarkReading {
  MarkState state = MarkState::Lost;
  int mark = 0;
  int code = kNoCode;  ///< kNoCode if there is none or one of its bits is neither lit nor dark
  double white =
      0.0;  ///< light of the cell that is always lit, which gives the gain of this picture
};

/// The codes of the first pictures, with which the cells are found: each code cell is lit in a
/// combination of the three dark pictures that no mark cell has.
inline constexpr std::array<int, 4> kFindingCodes = {0b111, 0b010, 0b100, 0b000};

/// MarkReader maps camera pixels to cells. Immutable.
class MarkReader {
 public:
  /// Finds the cells in pictures of the dark panel with marks 0, 1 and 2 and of the white panel.
  /// Returns nothing if a cell of the marks cannot be found or has too few pixels. The reader reads
  /// codes if their cells are found too.
  [[nodiscard]] static std::optional<MarkReader> find(const std::array<GreyPicture, 3>& dark_marks,
                                                      const GreyPicture& white);

  [[nodiscard]] bool reads_codes() const { return coded_; }

  [[nodiscard]] MarkReading read(const GreyPicture& picture) const;
  /// Returns how far the picture's marks have moved since they were found, in camera pixels: least
  /// squares over the edges of the cell that is always lit, valid for a few pixels. Zero without
  /// light.
  [[nodiscard]] Vec2 moved(const GreyPicture& picture) const;

 private:
  /// EdgePixel is a pixel at an edge, with the change of its light when the marks move.
  struct EdgePixel {
    uint32_t pixel;
    float light;
    Vec2 slope;  ///< change of light per camera pixel that the marks move
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
