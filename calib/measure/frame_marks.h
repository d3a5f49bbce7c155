// SPDX-License-Identifier: Apache-2.0
// MarkReader finds the marks in a camera's pictures and reads their number.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "base/error_kinds.h"
#include "base/statistics.h"
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
                                                      const GreyPicture& white) {
    const CellMap map(dark_marks, white);
    MarkReader reader;
    // Pictures in which each cell is lit, and in which it is dark.
    constexpr std::array<size_t, MarkCells::kMost> kLitPicture = {0, 1, 2, 1, 0, 0, 0};
    constexpr std::array<size_t, MarkCells::kMost> kDarkPicture = {0, 0, 0, 0, 1, 2, 1};
    reader.coded_ = true;
    for (size_t cell = 0; cell < MarkCells::kMost; ++cell) {
      std::vector<uint32_t>& pixels = reader.pixels_[cell];
      pixels = map.pixels(static_cast<int>(cell), 5);
      if (pixels.size() < kFewestPixels) {
        if (cell < MarkCells::kMarks) return std::nullopt;
        reader.coded_ = false;
        continue;
      }
      reader.lit_[cell] = mean_of(dark_marks[kLitPicture[cell]], pixels);
      reader.dark_[cell] = cell == 0 ? 0.0 : mean_of(dark_marks[kDarkPicture[cell]], pixels);
    }
    reader.find_edges(dark_marks[0], map.pixels(0, 1));
    return reader;
  }

  [[nodiscard]] MarkReading read(const GreyPicture& picture) const {
    MarkReading reading;
    reading.white = mean_of(picture, pixels_[0]);
    // The gain may drift, so light is measured relative to the cell that is always lit.
    const double gain = lit_[0] > 0.0 ? reading.white / lit_[0] : 0.0;
    if (!(gain > 0.2)) return reading;
    bool settled = true;
    std::array<bool, MarkCells::kMost> lit{};
    int code = 0;
    const size_t cells = coded_ ? MarkCells::kMost : MarkCells::kMarks;
    for (size_t cell = 1; cell < cells; ++cell) {
      const double part = part_lit(picture, cell, gain);
      const bool clear = part > kLit || part < kDark;
      lit[cell] = part > 0.5;
      if (cell >= MarkCells::kMarks) {
        if (!clear) code = kNoCode;
        if (code != kNoCode && lit[cell]) code += 1 << (cell - MarkCells::kMarks);
        continue;
      }
      if (!(part > kDarkest && part < kBrightest)) return reading;
      settled = settled && clear;
    }
    reading.state = MarkState::Unsettled;
    reading.mark = (lit[1] ? 1 : 0) + (lit[2] ? 2 : 0);
    reading.code = coded_ ? code : kNoCode;
    if (settled && lit[3] == (lit[1] != lit[2])) reading.state = MarkState::Read;
    return reading;
  }
  /// Returns how far the picture's marks have moved since they were found, in camera pixels: least
  /// squares over the edges of the cell that is always lit, valid for a few pixels. Zero without
  /// light.
  [[nodiscard]] Vec2 moved(const GreyPicture& picture) const {
    const double white = mean_of(picture, pixels_[0]);
    if (!(white > 0.0)) return {};
    const double gain = lit_[0] / white;
    double xx = 0.0, xy = 0.0, yy = 0.0, x = 0.0, y = 0.0;
    for (const EdgePixel& edge : edges_) {
      const double change = gain * double{picture.light[edge.pixel]} - double{edge.light};
      xx += edge.slope.x * edge.slope.x;
      xy += edge.slope.x * edge.slope.y;
      yy += edge.slope.y * edge.slope.y;
      x += edge.slope.x * change;
      y += edge.slope.y * change;
    }
    const double determinant = xx * yy - xy * xy;
    if (!(determinant > 1e-6 * xx * yy)) return {};
    return {(yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant};
  }

 private:
  /// Fewer pixels than this count as noise.
  static constexpr size_t kFewestPixels = 6;
  /// Limits of lit and dark, between a cell's own two light values.
  static constexpr double kLit = 0.75;
  static constexpr double kDark = 0.25;
  /// Beyond these limits the cells have changed, for example because a person covers them.
  static constexpr double kBrightest = 1.8;
  static constexpr double kDarkest = -0.4;

  /// CellMap assigns each pixel to a cell by the pictures in which it is lit; -1 for none.
  class CellMap {
   public:
    CellMap(const std::array<GreyPicture, 3>& marks, const GreyPicture& white)
        : width_(white.width), cells_(white.size(), -1) {
      const float brightest = *std::max_element(white.light.begin(), white.light.end());
      for (size_t i = 0; i < white.size(); ++i) {
        // The white panel has marks too, one of them dark.
        const float most =
            std::max({white.light[i], marks[0].light[i], marks[1].light[i], marks[2].light[i]});
        if (most > 0.15F * brightest) cells_[i] = cell_at(marks, most, i);
      }
    }

    /// Returns the pixels of which, together with their four neighbours, at least `least` belong to
    /// a cell: 1 for the cell and its surroundings, 5 for its inner part, because blur mixes the
    /// borders.
    [[nodiscard]] std::vector<uint32_t> pixels(int cell, ptrdiff_t least) const {
      std::vector<uint32_t> found;
      const auto width = static_cast<size_t>(width_);
      for (size_t i = width + 1; i + width + 1 < cells_.size(); ++i) {
        const std::array<size_t, 5> around = {i, i - 1, i + 1, i - width, i + width};
        if (std::ranges::count_if(around, [&](size_t k) { return cells_[k] == cell; }) >= least)
          found.push_back(static_cast<uint32_t>(i));
      }
      return found;
    }

   private:
    /// Returns the cell by the pictures (mark 0, 1, 2) in which it is lit: the first cell always,
    /// bit 0 with 1, bit 1 with 2, parity with both, the cells of the code as in kFindingCodes.
    static int8_t cell_at(const std::array<GreyPicture, 3>& marks, float white, size_t i) {
      std::array<bool, 3> lit{};
      for (size_t k = 0; k < 3; ++k) lit[k] = marks[k].light[i] > 0.5F * white;
      if (lit[0] && lit[1]) return lit[2] ? 0 : 5;
      if (lit[0]) return lit[2] ? 6 : 4;
      if (lit[1]) return lit[2] ? 3 : 1;
      return lit[2] ? 2 : -1;
    }

    int width_;
    std::vector<int8_t> cells_;
  };
  /// EdgePixel is a pixel at an edge, with the change of its light when the marks move.
  struct EdgePixel {
    uint32_t pixel;
    float light;
    Vec2 slope;  ///< change of light per camera pixel that the marks move
  };
  /// Finds the edges, except the edge toward the next cell, which changes with the mark.
  void find_edges(const GreyPicture& dark, const std::vector<uint32_t>& around) {
    const auto middle_of = [&](size_t cell) {
      Vec2 sum;
      for (const uint32_t i : pixels_[cell])
        sum = sum + Vec2{double(i % static_cast<uint32_t>(dark.width)),
                         double(i / static_cast<uint32_t>(dark.width))};
      return sum * (1.0 / static_cast<double>(pixels_[cell].size()));
    };
    const Vec2 own = middle_of(0), next = middle_of(1) - own;
    const double most = 0.25 * (next.x * next.x + next.y * next.y);
    const auto width = static_cast<uint32_t>(dark.width);
    for (const uint32_t i : around) {
      const Vec2 from = Vec2{double(i % width), double(i / width)} - own;
      if (from.x * next.x + from.y * next.y > most) continue;
      const std::vector<float>& light = dark.light;
      edges_.push_back({i,
                        light[i],
                        {0.5 * (double{light[i - 1]} - double{light[i + 1]}),
                         0.5 * (double{light[i - width]} - double{light[i + width]})}});
    }
  }
  /// Returns 0 for the light of the dark cell, 1 for the light of the lit cell.
  [[nodiscard]] double part_lit(const GreyPicture& picture, size_t cell, double gain) const {
    const double light = mean_of(picture, pixels_[cell]) / gain;
    return (light - dark_[cell]) / (lit_[cell] - dark_[cell]);
  }

  std::array<std::vector<uint32_t>, MarkCells::kMost> pixels_;
  std::array<double, MarkCells::kMost> dark_{};  ///< mean light of the cell when it is dark
  std::array<double, MarkCells::kMost> lit_{};
  std::vector<EdgePixel> edges_;
  bool coded_ = false;
};

inline constexpr size_t kFirstDigit = kFindingCodes.size();
inline constexpr size_t kHexDigits = 16;
inline constexpr size_t kDigits = (4 * kHexDigits + kCodeBits - 1) / kCodeBits;

/// RigCode encodes the fingerprint of the patterns' rig as codes beside their marks: each pattern,
/// after those that locate the cells, shows one digit of the fingerprint.
class RigCode {
 public:
  /// Takes the text of optics::fingerprint(rig).
  explicit RigCode(const std::string& fingerprint) : fingerprint_(fingerprint) {
    LENTICULE_CHECK(fingerprint.size() == kHexDigits);
    uint64_t number = std::stoull(fingerprint, nullptr, 16);
    for (size_t k = 0; k < kDigits; ++k, number >>= kCodeBits)
      digits_.push_back(static_cast<int>(number & ((1U << kCodeBits) - 1U)));
  }

  /// Returns the code of pattern number n.
  [[nodiscard]] int of_pattern(size_t n) const {
    return n < kFirstDigit ? kFindingCodes[n] : digits_[(n - kFirstDigit) % kDigits];
  }
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
  [[nodiscard]] size_t read() const {
    size_t count = 0;
    for (size_t n = kFirstDigit; n < codes_.size(); ++n) count += codes_[n] != kNoCode ? 1 : 0;
    return count;
  }
  /// Returns the number (from 0) of the first picture that shows another rig's code.
  [[nodiscard]] std::optional<size_t> first_foreign(const RigCode& expected) const {
    for (size_t n = kFirstDigit; n < codes_.size(); ++n)
      if (codes_[n] != kNoCode && codes_[n] != expected.of_pattern(n)) return n;
    return std::nullopt;
  }
  /// Returns the fingerprint shown by the pictures from number `first` on; empty unless every digit
  /// was read and repeated readings agree.
  [[nodiscard]] std::optional<std::string> fingerprint(size_t first = 0) const {
    std::array<int, kDigits> digits{};
    digits.fill(kNoCode);
    for (size_t n = std::max(first, kFirstDigit); n < codes_.size(); ++n) {
      if (codes_[n] == kNoCode) continue;
      int& digit = digits[(n - kFirstDigit) % kDigits];
      if (digit != kNoCode && digit != codes_[n]) return std::nullopt;
      digit = codes_[n];
    }
    uint64_t number = 0;
    for (size_t k = 0; k < kDigits; ++k) {
      if (digits[k] == kNoCode) return std::nullopt;
      number |= static_cast<uint64_t>(digits[k]) << (kCodeBits * k);
    }
    return fmt::format("{:016x}", number);
  }

 private:
  std::vector<int> codes_;
};

/// Throws Error(Input) if the pictures of a place show the code of another rig: patterns of another
/// pitch would give another pitch as the result.
inline void check_codes(const RigCodeReadings& codes, const RigCode& expected,
                        const std::string& place) {
  const std::optional<size_t> foreign = codes.first_foreign(expected);
  if (!foreign) return;
  const std::string remedy =
      "use the rig that these patterns were written for as --rig, or write patterns for this one "
      "and photograph them";
  if (const std::optional<std::string> other = codes.fingerprint())
    throw input_error(
        "{}: the photographs show patterns for the rig with fingerprint {}, "
        "not for {}",
        place, *other, expected.fingerprint())
        .remedy(remedy);
  throw input_error(
      "{}: photograph {} shows a pattern for another rig than the one with "
      "fingerprint {}",
      place, *foreign + 1, expected.fingerprint())
      .remedy(remedy);
}

// Finds out from the marks whether camera or panel moved between two pictures of one place.

/// Movement of the marks, in camera pixels, from which on a place counts as knocked. Good
/// sequences have steps of 0.02 to 0.06.
inline constexpr double kKnockPx = 0.25;

/// MarkStep is a lasting change of the marks' place.
struct MarkStep {
  size_t picture = 0;  ///< number, from 0, of the first picture after the step
  double length_px = 0.0;
};

inline constexpr size_t kFewestMoves = 4;

inline Vec2 mean_move(const std::vector<Vec2>& moves, size_t begin, size_t end) {
  std::vector<double> x, y;
  for (size_t n = begin; n < end; ++n) {
    x.push_back(moves[n].x);
    y.push_back(moves[n].y);
  }
  return {upper_median(std::move(x)), upper_median(std::move(y))};
}

/// Returns the sum of the distances from the middle.
inline double spread_of_moves(const std::vector<Vec2>& moves, size_t begin, size_t end) {
  const Vec2 place = mean_move(moves, begin, end);
  double sum = 0.0;
  for (size_t n = begin; n < end; ++n)
    sum += std::abs(moves[n].x - place.x) + std::abs(moves[n].y - place.y);
  return sum;
}

/// Returns the largest step above kKnockPx. Takes MarkReader::moved of each picture, in their
/// order. A step needs four pictures on each side: single readings vary with the light around the
/// marks, but medians of many do not.
[[nodiscard]] inline std::optional<MarkStep> find_step(const std::vector<Vec2>& moves) {
  size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (size_t n = kFewestMoves; n + kFewestMoves <= moves.size(); ++n) {
    const double sum = spread_of_moves(moves, 0, n) + spread_of_moves(moves, n, moves.size());
    if (sum >= least) continue;
    least = sum;
    best = n;
  }
  if (best == 0) return std::nullopt;
  const Vec2 step = mean_move(moves, best, moves.size()) - mean_move(moves, 0, best);
  const double length = std::hypot(step.x, step.y);
  return length > kKnockPx ? std::optional(MarkStep{best, length}) : std::nullopt;
}

/// Returns "the camera moved between photograph A and B", numbers from 1; `picture` as in MarkStep.
[[nodiscard]] inline std::string moved_between(size_t picture) {
  return fmt::format("the camera moved between photograph {} and {}", picture, picture + 1);
}

}  // namespace lenticule::calib
