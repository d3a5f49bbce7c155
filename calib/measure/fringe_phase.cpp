// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/fringe_phase.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include "base/statistics.h"
#include "calib/linear_algebra.h"

namespace lenticule::calib {
namespace {

constexpr size_t kFewestSightings = 30;
/// Sightings further off than this many typical errors count as wrong.
constexpr double kOutlier = 5.0;
constexpr int kRounds = 4;

/// Normalizer shifts and scales points so that their coordinates are about one: otherwise the
/// normal equations of a homography lose all digits.
struct Normalizer {
  Vec2 middle;
  double scale = 1.0;

  template <class PointOf>
  Normalizer(const std::vector<Sighting>& sightings, const PointOf& point) {
    for (const Sighting& s : sightings) middle = middle + point(s);
    middle = middle * (1.0 / static_cast<double>(sightings.size()));
    double spread = 0.0;
    for (const Sighting& s : sightings) {
      const Vec2 d = point(s) - middle;
      spread += d.x * d.x + d.y * d.y;
    }
    spread = std::sqrt(spread / static_cast<double>(sightings.size()));
    scale = spread > 0.0 ? 1.0 / spread : 1.0;
  }
  [[nodiscard]] Vec2 of(Vec2 p) const { return (p - middle) * scale; }
  [[nodiscard]] Eigen::Matrix3d matrix() const {
    Eigen::Matrix3d m;
    m << scale, 0, -scale * middle.x, 0, scale, -scale * middle.y, 0, 0, 1;
    return m;
  }
  [[nodiscard]] Eigen::Matrix3d inverse() const {
    Eigen::Matrix3d m;
    m << 1 / scale, 0, middle.x, 0, 1 / scale, middle.y, 0, 0, 1;
    return m;
  }
};

double length_of(Vec2 v) { return std::hypot(v.x, v.y); }

}  // namespace

Vec2 map_through(const Homography& h, Vec2 p) {
  const double w = h[6] * p.x + h[7] * p.y + h[8];
  return {(h[0] * p.x + h[1] * p.y + h[2]) / w, (h[3] * p.x + h[4] * p.y + h[5]) / w};
}

std::optional<Homography> fit_homography(const std::vector<Sighting>& sightings) {
  if (sightings.size() < 4) return std::nullopt;
  const Normalizer camera(sightings, [](const Sighting& s) { return s.camera_px; });
  const Normalizer panel(sightings, [](const Sighting& s) { return s.panel_px; });
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(9, 9);
  for (const Sighting& s : sightings) {
    const Vec2 a = camera.of(s.camera_px), b = panel.of(s.panel_px);
    Eigen::Matrix<double, 9, 1> row_x, row_y;
    row_x << a.x, a.y, 1, 0, 0, 0, -b.x * a.x, -b.x * a.y, -b.x;
    row_y << 0, 0, 0, a.x, a.y, 1, -b.y * a.x, -b.y * a.y, -b.y;
    normal += s.weight * (row_x * row_x.transpose() + row_y * row_y.transpose());
  }
  const SymmetricAxes axes = axes_of_symmetric(normal);
  // Two small eigenvalues mean that the points lie on a line.
  if (!(axes.values[1] > 1e-12 * axes.values[8])) return std::nullopt;
  const Eigen::VectorXd v = axes.vectors.col(0);
  Eigen::Matrix3d h;
  h << v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8];
  h = panel.inverse() * h * camera.matrix();
  Homography out{};
  for (int i = 0; i < 9; ++i) out[static_cast<size_t>(i)] = h(i / 3, i % 3);
  const bool finite = std::ranges::all_of(out, [](double x) { return std::isfinite(x); });
  return finite ? std::optional(out) : std::nullopt;
}

std::array<double, PanelMap::kTerms> PanelMap::terms(Vec2 camera_px) const {
  const Vec2 p = (camera_px - middle_) * scale_;
  std::array<double, kTerms> out{};
  size_t n = 0;
  double of_x = 1.0;
  for (int a = 0; a <= kDegree; ++a, of_x *= p.x) {
    double term = of_x;
    for (int b = 0; a + b <= kDegree; ++b, term *= p.y) out[n++] = term;
  }
  return out;
}

Vec2 PanelMap::at(Vec2 camera_px) const {
  Vec2 sum = map_through(homography_, camera_px);
  const std::array<double, kTerms> t = terms(camera_px);
  for (size_t n = 0; n < t.size(); ++n) sum = sum + polynomial_[n] * t[n];
  return sum;
}

std::vector<double> PanelMap::errors_of(const std::vector<Sighting>& sightings) const {
  std::vector<double> errors;
  errors.reserve(sightings.size());
  for (const Sighting& s : sightings) errors.push_back(length_of(at(s.camera_px) - s.panel_px));
  return errors;
}

bool PanelMap::fit_polynomial(const std::vector<Sighting>& sightings,
                              const std::vector<double>& errors) {
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(kTerms, kTerms);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(kTerms, 2);
  const double limit = kOutlier * std::max(typical_error_px_, 1e-6);
  for (size_t n = 0; n < sightings.size(); ++n) {
    if (errors[n] > limit) continue;
    const Sighting& s = sightings[n];
    const std::array<double, kTerms> t = terms(s.camera_px);
    const Eigen::Map<const Eigen::VectorXd> row(t.data(), kTerms);
    const Vec2 rest = s.panel_px - map_through(homography_, s.camera_px);
    normal += s.weight * row * row.transpose();
    right.col(0) += s.weight * rest.x * row;
    right.col(1) += s.weight * rest.y * row;
  }
  const Eigen::MatrixXd solution = solve_symmetric(normal, right);
  if (!solution.allFinite()) return false;
  for (int n = 0; n < kTerms; ++n)
    polynomial_[static_cast<size_t>(n)] = {solution(n, 0), solution(n, 1)};
  return true;
}

std::optional<PanelMap> PanelMap::fit(const std::vector<Sighting>& sightings) {
  if (sightings.size() < kFewestSightings) return std::nullopt;
  const Normalizer camera(sightings, [](const Sighting& s) { return s.camera_px; });
  PanelMap map;
  map.middle_ = camera.middle;
  map.scale_ = camera.scale;
  std::vector<Sighting> kept = sightings;
  for (int round = 0; round < kRounds; ++round) {
    const std::optional<Homography> h = fit_homography(kept);
    if (!h) return std::nullopt;
    map.homography_ = *h;
    map.polynomial_ = {};
    std::vector<double> errors = map.errors_of(kept);
    map.typical_error_px_ = upper_median(errors);
    if (!map.fit_polynomial(kept, errors)) return std::nullopt;
    errors = map.errors_of(sightings);
    map.typical_error_px_ = upper_median(errors);
    kept.clear();
    for (size_t n = 0; n < sightings.size(); ++n)
      if (errors[n] <= kOutlier * std::max(map.typical_error_px_, 1e-6))
        kept.push_back(sightings[n]);
    if (kept.size() < kFewestSightings) return std::nullopt;
  }
  return map;
}

PhaseSum::PhaseSum(size_t pixels, int steps) : steps_(steps), waves_(pixels), means_(pixels) {}

void PhaseSum::add(const GreyPicture& picture, std::span<const uint32_t> pixels, double phase) {
  const double angle = 2.0 * std::numbers::pi * phase;
  const double share = 2.0 / steps_;
  const auto cosine = static_cast<float>(share * std::cos(angle));
  const auto sine = static_cast<float>(share * std::sin(angle));
  const auto mean = static_cast<float>(1.0 / steps_);
  for (size_t n = 0; n < pixels.size(); ++n) {
    const float light = picture.light[pixels[n]];
    waves_[n] += Complex(light * cosine, light * sine);
    means_[n] += light * mean;
  }
}

namespace {

/// The widest period exceeds the axis by this factor, so that noise at one end cannot be mistaken
/// for the other end.
constexpr double kMargin = 1.15;
constexpr double kFinestPart = 1.0 / 64.0;
constexpr double kFewestLenses = 6.0;
constexpr double kFinestPixels = 24.0;

/// Returns turns in [0, 1).
double turns_of(Complex wave) {
  const double turns =
      std::atan2(double{wave.imag()}, double{wave.real()}) / (2.0 * std::numbers::pi);
  return turns < 0.0 ? turns + 1.0 : turns;
}

}  // namespace

std::array<WaveLevel, 3> wave_levels(int axis_px, double lens_pitch_px) {
  const double widest = kMargin * axis_px;
  const double finest =
      std::min(widest / 9.0,
               std::max({axis_px * kFinestPart, kFewestLenses * lens_pitch_px, kFinestPixels}));
  return {{{.period_px = widest, .steps = 4},
           {.period_px = std::sqrt(widest * finest), .steps = 4},
           {.period_px = finest, .steps = 8}}};
}

std::vector<float> decode_positions(const std::array<WaveLevel, 3>& levels,
                                    const std::array<PhaseSum, 3>& sums, float least) {
  const size_t count = sums[0].waves().size();
  std::vector<float> positions(count, std::numeric_limits<float>::quiet_NaN());
  for (size_t n = 0; n < count; ++n) {
    if (std::abs(sums[2].waves()[n]) < least) continue;
    double turns = turns_of(sums[0].waves()[n]);
    // The position is slightly before the first pixel, not far beyond the last.
    if (turns > 0.5 * (1.0 + 1.0 / kMargin)) turns -= 1.0;
    double position = turns * levels[0].period_px;
    for (size_t level = 1; level < levels.size(); ++level) {
      const double period = levels[level].period_px;
      const double part = turns_of(sums[level].waves()[n]);
      position = (std::round(position / period - part) + part) * period;
    }
    positions[n] = static_cast<float>(position);
  }
  return positions;
}

namespace {

using Complex64 = std::complex<double>;

constexpr int kGridColumns = 1024;
constexpr int kGridRows = 512;
/// A block filled with less than this fraction of pixels is not reliable.
constexpr double kLeastFilled = 0.5;
constexpr double kLeastCoherence = 0.2;

/// Returns the wave after subtracting `model`: its angle is 2 pi (model - Phi_E).
Complex64 demodulated(const FringeView& view, size_t n, const LinearPhase& model,
                      const optics::Panel& panel) {
  const Vec2 p = view.panel_px[n];
  const double s =
      3.0 * ((p.x - panel.width_px / 2.0) + view.fringe.slant * (p.y - panel.height_px / 2.0));
  const double turns = s / view.fringe.pitch_subpx - model.at(p, panel);
  return Complex64(view.waves[n]) *
         std::polar(1.0, -2.0 * std::numbers::pi * (turns - std::round(turns)));
}

int signed_frequency(int k, int count) { return k < count / 2 ? k : k - count; }

/// Spectrum is a complex picture of the panel and its two-dimensional spectrum.
class Spectrum {
 public:
  Spectrum() : cells_(static_cast<size_t>(kGridColumns) * kGridRows) {}

  /// Distributes a value over the four cells around, which keeps the side peaks of rounding low.
  void splat(Vec2 panel_px, Complex64 value, const optics::Panel& panel) {
    const double x = panel_px.x / panel.width_px * kGridColumns - 0.5;
    const double y = panel_px.y / panel.height_px * kGridRows - 0.5;
    const auto column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
    if (column < 0 || row < 0 || column + 1 >= kGridColumns || row + 1 >= kGridRows) return;
    const double right = x - column, below = y - row;
    cell(column, row) += value * ((1.0 - right) * (1.0 - below));
    cell(column + 1, row) += value * (right * (1.0 - below));
    cell(column, row + 1) += value * ((1.0 - right) * below);
    cell(column + 1, row + 1) += value * (right * below);
  }

  void transform() {
    Eigen::FFT<double> fft;
    std::vector<Complex64> line, spectrum;
    for (int y = 0; y < kGridRows; ++y) {
      line.assign(&cell(0, y), &cell(0, y) + kGridColumns);
      fft.fwd(spectrum, line);
      std::copy(spectrum.begin(), spectrum.end(), &cell(0, y));
    }
    line.resize(kGridRows);
    for (int x = 0; x < kGridColumns; ++x) {
      for (int y = 0; y < kGridRows; ++y) line[static_cast<size_t>(y)] = cell(x, y);
      fft.fwd(spectrum, line);
      for (int y = 0; y < kGridRows; ++y) cell(x, y) = spectrum[static_cast<size_t>(y)];
    }
  }

  struct Peak {
    int x = 0;
    int y = 0;
    double height = 0.0;
  };
  /// Returns the highest cell of a frequency up to `most`, more than `away` cells from `from`.
  [[nodiscard]] Peak highest(double most, const Peak* from, int away) const {
    Peak best;
    for (int y = 0; y < kGridRows; ++y) {
      if (std::abs(signed_frequency(y, kGridRows)) > most) continue;
      for (int x = 0; x < kGridColumns; ++x) {
        if (std::abs(signed_frequency(x, kGridColumns)) > most) continue;
        const double height = std::abs(at(x, y));
        if (height > best.height && (from == nullptr || far(*from, x, y, away)))
          best = {x, y, height};
      }
    }
    return best;
  }
  [[nodiscard]] Complex64 at(int x, int y) const {
    return cells_[static_cast<size_t>((y + kGridRows) % kGridRows) * kGridColumns +
                  static_cast<size_t>((x + kGridColumns) % kGridColumns)];
  }

 private:
  Complex64& cell(int x, int y) { return cells_[static_cast<size_t>(y) * kGridColumns + x]; }
  static bool far(const Peak& from, int x, int y, int away) {
    const int dx = std::abs(x - from.x), dy = std::abs(y - from.y);
    return std::min(dx, kGridColumns - dx) > away || std::min(dy, kGridRows - dy) > away;
  }

  std::vector<Complex64> cells_;
};

/// Returns the position of a peak between its neighbours, by the parabola through the logarithms of
/// the three.
double between(double before, double at, double after) {
  const double a = std::log(std::max(before, 1e-300)), b = std::log(std::max(at, 1e-300)),
               c = std::log(std::max(after, 1e-300));
  const double curvature = a - 2.0 * b + c;
  return curvature < 0.0 ? std::clamp(0.5 * (a - c) / curvature, -0.5, 0.5) : 0.0;
}

/// BlockSum holds the sums over the pixels of one block.
struct BlockSum {
  Complex64 wave;
  double strength = 0.0;
  double square = 0.0;
  Vec2 camera;
  int pixels = 0;
};

PhaseBlock block_of(const BlockSum& sum, const PanelMap& map, const LinearPhase& model,
                    const optics::Panel& panel) {
  PhaseBlock block;
  const double count = sum.pixels;
  block.camera_px = sum.camera * (1.0 / count);
  block.panel_px = map.at(block.camera_px);
  block.strength = sum.strength / count;
  block.coherence = sum.strength > 0.0 ? std::abs(sum.wave) / sum.strength : 0.0;
  if (block.coherence < kLeastCoherence) return block;
  block.pixels = sum.pixels;
  const double rest = -std::arg(sum.wave) / (2.0 * std::numbers::pi);
  block.phase = model.at(block.panel_px, panel) + rest;
  // Half of the scatter is perpendicular to the mean wave and changes its angle.
  const double mean = std::abs(sum.wave) / count;
  const double scatter = std::max(0.0, sum.square / count - mean * mean);
  block.sigma = std::sqrt(0.5 * scatter / count) / (2.0 * std::numbers::pi * mean);
  return block;
}

/// Unwraps the phases: removes whole lenses from each block so that it continues its neighbours,
/// breadth first from the most coherent block.
void continue_phases(BlockGrid& grid, const LinearPhase& model, const optics::Panel& panel) {
  std::vector<uint8_t> done(grid.blocks.size(), 0);
  const auto rest_of = [&](const PhaseBlock& b) { return b.phase - model.at(b.panel_px, panel); };
  const auto better = [&](size_t a, size_t b) {
    return grid.blocks[a].coherence * std::sqrt(grid.blocks[a].pixels) <
           grid.blocks[b].coherence * std::sqrt(grid.blocks[b].pixels);
  };
  size_t start = 0;
  for (size_t n = 1; n < grid.blocks.size(); ++n)
    if (better(start, n)) start = n;
  std::deque<size_t> waiting{start};
  done[start] = 1;
  while (!waiting.empty()) {
    const size_t at = waiting.front();
    waiting.pop_front();
    const auto column = static_cast<int>(at) % grid.columns,
               row = static_cast<int>(at) / grid.columns;
    constexpr std::array<std::array<int, 2>, 4> kAround = {{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
    for (const auto& [dx, dy] : kAround) {
      const int x = column + dx, y = row + dy;
      if (x < 0 || y < 0 || x >= grid.columns || y >= grid.rows) continue;
      const size_t next = static_cast<size_t>(y) * static_cast<size_t>(grid.columns) + x;
      if (done[next] != 0 || grid.blocks[next].pixels == 0) continue;
      grid.blocks[next].phase -= std::round(rest_of(grid.blocks[next]) - rest_of(grid.blocks[at]));
      done[next] = 1;
      waiting.push_back(next);
    }
  }
  // A block not connected by neighbours has an unknown whole part.
  for (size_t n = 0; n < grid.blocks.size(); ++n)
    if (done[n] == 0) grid.blocks[n].pixels = 0;
}

}  // namespace

std::optional<FringePeak> find_fringes(const FringeView& view, const LinearPhase& start,
                                       double most_fringes, const optics::Panel& panel) {
  Spectrum spectrum;
  double all = 0.0;
  for (size_t n = 0; n < view.waves.size(); ++n) {
    spectrum.splat(view.panel_px[n], demodulated(view, n, start, panel), panel);
    all += std::abs(view.waves[n]);
  }
  if (!(all > 0.0)) return std::nullopt;
  spectrum.transform();
  const Spectrum::Peak peak = spectrum.highest(most_fringes, nullptr, 0);
  const auto height = [&](int dx, int dy) {
    return std::abs(spectrum.at(peak.x + dx, peak.y + dy));
  };
  const double fx =
      signed_frequency(peak.x, kGridColumns) + between(height(-1, 0), peak.height, height(1, 0));
  const double fy =
      signed_frequency(peak.y, kGridRows) + between(height(0, -1), peak.height, height(0, 1));
  FringePeak found{.phase = start,
                   .height = peak.height / all,
                   .second = spectrum.highest(most_fringes, &peak, 6).height / all};
  // The spectrum's angle grows with start - Phi_E.
  found.phase.per_px_x -= fx / panel.width_px;
  found.phase.per_px_y -= fy / panel.height_px;
  Complex64 sum;
  for (size_t n = 0; n < view.waves.size(); ++n) sum += demodulated(view, n, found.phase, panel);
  found.phase.constant -= std::arg(sum) / (2.0 * std::numbers::pi);
  return found;
}

BlockGrid average_blocks(const FringeView& view, const std::vector<uint32_t>& pixels,
                         int picture_width, int picture_height, int block_px, const PanelMap& map,
                         const LinearPhase& model, const optics::Panel& panel) {
  BlockGrid grid{.columns = (picture_width + block_px - 1) / block_px,
                 .rows = (picture_height + block_px - 1) / block_px,
                 .blocks = {}};
  std::vector<BlockSum> sums(static_cast<size_t>(grid.columns) * static_cast<size_t>(grid.rows));
  for (size_t n = 0; n < pixels.size(); ++n) {
    const int x = static_cast<int>(pixels[n]) % picture_width;
    const int y = static_cast<int>(pixels[n]) / picture_width;
    BlockSum& sum = sums[static_cast<size_t>(y / block_px) * static_cast<size_t>(grid.columns) +
                         static_cast<size_t>(x / block_px)];
    const Complex64 wave = demodulated(view, n, model, panel);
    sum.wave += wave;
    sum.strength += std::abs(wave);
    sum.square += std::norm(wave);
    sum.camera = sum.camera + Vec2{x + 0.5, y + 0.5};
    ++sum.pixels;
  }
  const double fewest = kLeastFilled * block_px * block_px;
  for (const BlockSum& sum : sums)
    grid.blocks.push_back(sum.pixels >= fewest ? block_of(sum, map, model, panel) : PhaseBlock{});
  continue_phases(grid, model, panel);
  return grid;
}

std::optional<LinearPhase> fit_linear(const BlockGrid& grid, const optics::Panel& panel) {
  LinearPhase line;
  double scale = 0.25;  // lenses: larger deviations get a smaller weight
  for (int round = 0; round < 12; ++round) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const PhaseBlock& b : grid.blocks) {
      if (b.pixels == 0) continue;
      const Eigen::Vector3d row(1.0, (b.panel_px.x - panel.width_px / 2.0) / panel.width_px,
                                (b.panel_px.y - panel.height_px / 2.0) / panel.height_px);
      const double off = round == 0 ? 0.0 : (b.phase - line.at(b.panel_px, panel)) / scale;
      const double weight = b.pixels / (1.0 + off * off);
      normal += weight * row * row.transpose();
      right += weight * b.phase * row;
    }
    const Eigen::Vector3d solution = solve_symmetric(normal, right);
    if (!(normal.determinant() > 0.0) || !solution.allFinite()) return std::nullopt;
    line = {.constant = solution[0],
            .per_px_x = solution[1] / panel.width_px,
            .per_px_y = solution[2] / panel.height_px};
  }
  return line;
}

double largest_change(const BlockGrid& before, BlockGrid after, const optics::Panel& panel) {
  for (size_t n = 0; n < after.blocks.size(); ++n) {
    PhaseBlock& block = after.blocks[n];
    if (before.blocks[n].pixels == 0) block.pixels = 0;
    block.phase -= before.blocks[n].phase;
    block.phase -= std::round(block.phase);
  }
  const std::optional<LinearPhase> move = fit_linear(after, panel);
  if (!move) return 0.0;
  // A camera that moved shifts all phases, a sheet that warmed up stretches them: the largest
  // change is in a corner.
  double largest = 0.0;
  for (const double x : {0.0, 1.0})
    for (const double y : {0.0, 1.0})
      largest =
          std::max(largest, std::abs(move->at({x * panel.width_px, y * panel.height_px}, panel)));
  return largest;
}

}  // namespace lenticule::calib
