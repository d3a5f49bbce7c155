// SPDX-License-Identifier: Apache-2.0
// Measures the phase that the camera's eye sees over the panel, from fringes. A pattern of pitch p
// shows the phase theta / 2 pi = s / p - Phi_E (mod 1) at a camera pixel that sees panel point Q,
// where s is the pattern's own coordinate at Q and Phi_E the lens coordinate seen there
// (docs/panel/optics.md).
#pragma once

#include <array>
#include <complex>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "calib/measure/pattern.h"
#include "optics/panel.h"
#include "optics/vec.h"

namespace lenticule::calib {

// PanelMap maps camera pixels to panel points with one smooth map of the whole picture: a
// homography and a polynomial for its residual (lens distortion, refraction). Under a lens sheet
// the panel points of single pixels jump from lens to lens; the map goes through their middle.

/// Sighting is a camera pixel (its centre is at whole + 1/2) and the panel point seen there, in
/// pixels of both.
struct Sighting {
  Vec2 camera_px;
  Vec2 panel_px;
  double weight = 1.0;
};

using Homography = std::array<double, 9>;  ///< row by row

/// Returns the homography that maps camera to panel with the least squares of panel distance.
/// Returns nothing for fewer than four points or points on a line.
[[nodiscard]] std::optional<Homography> fit_homography(const std::vector<Sighting>& sightings);
[[nodiscard]] Vec2 map_through(const Homography& h, Vec2 p);

class PanelMap {
 public:
  /// Fits a map through at least 30 sightings all over the picture, some of which may be wrong.
  /// Returns nothing if there is no such map.
  [[nodiscard]] static std::optional<PanelMap> fit(const std::vector<Sighting>& sightings);

  [[nodiscard]] Vec2 at(Vec2 camera_px) const;
  /// Returns the median distance of the sightings from the map, panel pixels.
  [[nodiscard]] double typical_error_px() const { return typical_error_px_; }

 private:
  static constexpr int kDegree = 5;
  static constexpr int kTerms = (kDegree + 1) * (kDegree + 2) / 2;

  [[nodiscard]] std::array<double, kTerms> terms(Vec2 camera_px) const;
  bool fit_polynomial(const std::vector<Sighting>& sightings, const std::vector<double>& errors);
  [[nodiscard]] std::vector<double> errors_of(const std::vector<Sighting>& sightings) const;

  Homography homography_{};
  std::array<Vec2, kTerms> polynomial_{};
  Vec2 middle_;
  double scale_ = 1.0;
  double typical_error_px_ = 0.0;
};

// Phase stepping: the same sinusoid shown at K phases gives, at each camera pixel, the phase and
// the strength of the wave, independent of the background. K equal steps reject the harmonics 2 to
// K - 2 that a camera's curve adds.

using Complex = std::complex<float>;

/// PhaseSum sums light A + B cos(theta - 2 pi phase) of the K phases to B e^(i theta) and A.
class PhaseSum {
 public:
  PhaseSum(size_t pixels, int steps);

  /// Adds one picture's light at each pixel; the picture was shown at `phase` (turns).
  void add(const GreyPicture& picture, std::span<const uint32_t> pixels, double phase);

  /// Returns B e^(i theta) of each pixel.
  [[nodiscard]] const std::vector<Complex>& waves() const { return waves_; }
  /// Returns A of each pixel.
  [[nodiscard]] const std::vector<float>& means() const { return means_; }

 private:
  int steps_;
  std::vector<Complex> waves_;
  std::vector<float> means_;
};

// Decodes the panel point that each camera pixel sees, from wide sinusoids along both axes.

/// WaveLevel is one sinusoid of a panel axis: its period and its number of phase steps.
struct WaveLevel {
  double period_px = 0.0;
  int steps = 0;
};

/// Returns three levels, from one period for the whole axis down to a fine one. Each level is
/// coarse enough to be unwrapped by the previous one, and all are much wider than a lens.
[[nodiscard]] std::array<WaveLevel, 3> wave_levels(int axis_px, double lens_pitch_px);

/// Returns positions along one axis, in pixels, from the waves of its three levels; NaN where the
/// last level is weaker than `least` (same unit as the waves).
[[nodiscard]] std::vector<float> decode_positions(const std::array<WaveLevel, 3>& levels,
                                                  const std::array<PhaseSum, 3>& sums, float least);

/// FringeView is one set of phase-stepped fringes in camera pixels: the wave at each of `count`
/// pixels, and the panel points of the pixels from a smooth map. Borrowed.
struct FringeView {
  Fringe fringe;
  const std::vector<Complex>& waves;
  const std::vector<Vec2>& panel_px;
};

struct FringePeak {
  LinearPhase phase;
  double height = 0.0;  ///< fraction of all light that this phase explains, 0 to 1
  double second = 0.0;  ///< fraction of the next best phase, elsewhere
};

/// Returns the linear phase that explains most of the light, searched around `start` by a
/// periodogram: up to `most_fringes` more or less across the panel or from top to bottom (500
/// across and 250 down at most). Returns nothing without any light.
[[nodiscard]] std::optional<FringePeak> find_fringes(const FringeView& view,
                                                     const LinearPhase& start, double most_fringes,
                                                     const optics::Panel& panel);

/// PhaseBlock is the average over a square of camera pixels.
struct PhaseBlock {
  Vec2 camera_px;  ///< mean of its pixels
  Vec2 panel_px;   ///< smooth map at camera_px
  int pixels = 0;
  double phase = 0.0;      ///< Phi_E there, lenses; whole lenses are consistent between neighbours
  double sigma = 0.0;      ///< standard error of the phase, from the scatter inside the block
  double coherence = 0.0;  ///< 1 when all pixels agree
  double strength = 0.0;   ///< mean strength of the waves, in units of light
};

struct BlockGrid {
  int columns = 0;
  int rows = 0;
  std::vector<PhaseBlock> blocks;  ///< columns * rows; a block with pixels = 0 was not measured
};

/// Averages over squares of `block_px` camera pixels after subtracting `model`. `pixels` are
/// indices into a picture of width `picture_width`. The phase is unwrapped from block to block,
/// starting at the most coherent one.
[[nodiscard]] BlockGrid average_blocks(const FringeView& view, const std::vector<uint32_t>& pixels,
                                       int picture_width, int picture_height, int block_px,
                                       const PanelMap& map, const LinearPhase& model,
                                       const optics::Panel& panel);

/// Fits the robust weighted least-squares line through blocks.
[[nodiscard]] std::optional<LinearPhase> fit_linear(const BlockGrid& grid,
                                                    const optics::Panel& panel);

/// Returns the largest change, in lenses, of a plane fitted to the changes of the same blocks'
/// phases; 0 if no plane fits.
[[nodiscard]] double largest_change(const BlockGrid& before, BlockGrid after,
                                    const optics::Panel& panel);

}  // namespace lenticule::calib
