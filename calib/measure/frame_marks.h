// SPDX-License-Identifier: Apache-2.0
// MarkReader finds the marks in a camera's pictures and reads their number.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

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

/// RigCode encodes the fingerprint of the patterns' rig as codes beside their marks: each pattern,
/// after those that locate the cells, shows one digit of the fingerprint.
class RigCode {
 public:
  /// Takes the text of optics::fingerprint(rig).
  explicit RigCode(const std::string& fingerprint);

  /// Returns the code of pattern number n.
  [[nodiscard]] int of_pattern(size_t n) const;
  [[nodiscard]] const std::string& fingerprint() const { return fingerprint_; }

 private:
  std::string fingerprint_;
  std::vector<int> digits_;
};

/// RigCodeReadings collects the codes read from pictures of patterns, in their order.
class RigCodeReadings {
 public:
  /// Adds a code; kNoCode if none could be read.
  void add(int code) { codes_.push_back(code); }

  /// Returns the number of pictures with a code, without those that locate the cells.
  [[nodiscard]] size_t read() const;
  /// Returns the number (from 0) of the first picture that shows another rig's code.
  [[nodiscard]] std::optional<size_t> first_foreign(const RigCode& expected) const;
  /// Returns the fingerprint shown by the pictures from number `first` on; empty unless every digit
  /// was read and repeated readings agree.
  [[nodiscard]] std::optional<std::string> fingerprint(size_t first = 0) const;

 private:
  std::vector<int> codes_;
};

/// Throws Error(Input) if the pictures of a place show the code of another rig: patterns of another
/// pitch would give another pitch as the result.
void check_codes(const RigCodeReadings& codes, const RigCode& expected, const std::string& place);

// Finds out from the marks whether camera or panel moved between two pictures of one place.

/// Movement of the marks, in camera pixels, from which on a place counts as knocked. Good
/// sequences have steps of 0.02 to 0.06.
inline constexpr double kKnockPx = 0.25;

/// MarkStep is a lasting change of the marks' place.
struct MarkStep {
  size_t picture = 0;  ///< number, from 0, of the first picture after the step
  double length_px = 0.0;
};

/// Returns the largest step above kKnockPx. Takes MarkReader::moved of each picture, in their
/// order. A step needs four pictures on each side: single readings vary with the light around the
/// marks, but medians of many do not.
[[nodiscard]] std::optional<MarkStep> find_step(const std::vector<Vec2>& moves);

/// Returns "the camera moved between photograph A and B", numbers from 1; `picture` as in MarkStep.
[[nodiscard]] std::string moved_between(size_t picture);

}  // namespace lenticule::calib
