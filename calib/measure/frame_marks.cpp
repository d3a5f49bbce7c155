// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/frame_marks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/statistics.h"

namespace lenticule::calib {
namespace {

/// Fewer pixels than this count as noise.
constexpr size_t kFewestPixels = 6;
/// Limits of lit and dark, between a cell's own two light values.
constexpr double kLit = 0.75;
constexpr double kDark = 0.25;
/// Beyond these limits the cells have changed, for example because a person covers them.
constexpr double kBrightest = 1.8;
constexpr double kDarkest = -0.4;

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

  /// Returns the pixels of which, together with their four neighbours, at least `least` belong to a
  /// cell: 1 for the cell and its surroundings, 5 for its inner part, because blur mixes the
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
  /// Returns the cell by the pictures (mark 0, 1, 2) in which it is lit: the first cell always, bit
  /// 0 with 1, bit 1 with 2, parity with both, the cells of the code as in kFindingCodes.
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

}  // namespace

std::optional<MarkReader> MarkReader::find(const std::array<GreyPicture, 3>& dark_marks,
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

/// Finds the edges, except the edge toward the next cell, which changes with the mark.
void MarkReader::find_edges(const GreyPicture& dark, const std::vector<uint32_t>& around) {
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

Vec2 MarkReader::moved(const GreyPicture& picture) const {
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

/// Returns 0 for the light of the dark cell, 1 for the light of the lit cell.
double MarkReader::part_lit(const GreyPicture& picture, size_t cell, double gain) const {
  const double light = mean_of(picture, pixels_[cell]) / gain;
  return (light - dark_[cell]) / (lit_[cell] - dark_[cell]);
}

MarkReading MarkReader::read(const GreyPicture& picture) const {
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

namespace {

constexpr size_t kFirst = kFindingCodes.size();
constexpr size_t kHexDigits = 16;
constexpr size_t kDigits = (4 * kHexDigits + kCodeBits - 1) / kCodeBits;

}  // namespace

RigCode::RigCode(const std::string& fingerprint) : fingerprint_(fingerprint) {
  LENTICULE_CHECK(fingerprint.size() == kHexDigits);
  uint64_t number = std::stoull(fingerprint, nullptr, 16);
  for (size_t k = 0; k < kDigits; ++k, number >>= kCodeBits)
    digits_.push_back(static_cast<int>(number & ((1U << kCodeBits) - 1U)));
}

int RigCode::of_pattern(size_t n) const {
  return n < kFirst ? kFindingCodes[n] : digits_[(n - kFirst) % kDigits];
}

size_t RigCodeReadings::read() const {
  size_t count = 0;
  for (size_t n = kFirst; n < codes_.size(); ++n) count += codes_[n] != kNoCode ? 1 : 0;
  return count;
}

std::optional<size_t> RigCodeReadings::first_foreign(const RigCode& expected) const {
  for (size_t n = kFirst; n < codes_.size(); ++n)
    if (codes_[n] != kNoCode && codes_[n] != expected.of_pattern(n)) return n;
  return std::nullopt;
}

std::optional<std::string> RigCodeReadings::fingerprint(size_t first) const {
  std::array<int, kDigits> digits{};
  digits.fill(kNoCode);
  for (size_t n = std::max(first, kFirst); n < codes_.size(); ++n) {
    if (codes_[n] == kNoCode) continue;
    int& digit = digits[(n - kFirst) % kDigits];
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

void check_codes(const RigCodeReadings& codes, const RigCode& expected, const std::string& place) {
  const std::optional<size_t> foreign = codes.first_foreign(expected);
  if (!foreign) return;
  const std::string remedy =
      "use the rig that these patterns were written for as --rig, or write patterns for this one "
      "and photograph them";
  if (const std::optional<std::string> other = codes.fingerprint())
    throw Error(ErrorKind::Input,
                fmt::format("{}: the photographs show patterns for the rig with fingerprint {}, "
                            "not for {}",
                            place, *other, expected.fingerprint()),
                remedy);
  throw Error(ErrorKind::Input,
              fmt::format("{}: photograph {} shows a pattern for another rig than the one with "
                          "fingerprint {}",
                          place, *foreign + 1, expected.fingerprint()),
              remedy);
}

namespace {

constexpr size_t kFewest = 4;

Vec2 middle(const std::vector<Vec2>& moves, size_t begin, size_t end) {
  std::vector<double> x, y;
  for (size_t n = begin; n < end; ++n) {
    x.push_back(moves[n].x);
    y.push_back(moves[n].y);
  }
  return {upper_median(std::move(x)), upper_median(std::move(y))};
}

/// Returns the sum of the distances from the middle.
double misfit(const std::vector<Vec2>& moves, size_t begin, size_t end) {
  const Vec2 place = middle(moves, begin, end);
  double sum = 0.0;
  for (size_t n = begin; n < end; ++n)
    sum += std::abs(moves[n].x - place.x) + std::abs(moves[n].y - place.y);
  return sum;
}

}  // namespace

std::optional<MarkStep> find_step(const std::vector<Vec2>& moves) {
  size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (size_t n = kFewest; n + kFewest <= moves.size(); ++n) {
    const double sum = misfit(moves, 0, n) + misfit(moves, n, moves.size());
    if (sum >= least) continue;
    least = sum;
    best = n;
  }
  if (best == 0) return std::nullopt;
  const Vec2 step = middle(moves, best, moves.size()) - middle(moves, 0, best);
  const double length = std::hypot(step.x, step.y);
  return length > kKnockPx ? std::optional(MarkStep{best, length}) : std::nullopt;
}

std::string moved_between(size_t picture) {
  return fmt::format("the camera moved between photograph {} and {}", picture, picture + 1);
}

}  // namespace lenticule::calib
