// SPDX-License-Identifier: Apache-2.0
// Fits camera, places and sheet to several hand-held photographs of the chart at once.
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "calib/calibration.h"
#include "calib/fit/observations.h"
#include "calib/photo/single_photo.h"
#include "optics/rig.h"
#include "optics/vec.h"

namespace lenticule::calib {

/// Up to so many photographs determine the shifts of their axes badly: the fit leaves most of a
/// false axis to places and sheet.
inline constexpr size_t kFewPhotos = 3;

struct TurnedFit;

/// PhotoFit is the part of the fit that belongs to one photograph. Lengths in the pictures are in
/// pixels of the averaged pictures.
struct PhotoFit {
  double breathing = 0.0;       ///< focal length relative to the camera's, minus 1
  Vec2 shift;                   ///< axis minus the camera's, longer sides of the picture
  double breathing_pull = 0.0;  ///< breathing over the standard deviation of its prior
  double shift_pull = 0.0;      ///< shift over the standard deviation of its prior
  double phase_rms = 0.0;       ///< lenses; by the weights of the blocks
  double corner_rms_px = 0.0;
  std::vector<double> phase_rests;  ///< lenses, in the order of PhotoFindings::blocks
  Vec3 eye_sigma_mm;
};

/// PhoneFit is the result of the joint fit.
struct PhoneFit {
  FitValues values;  ///< the camera without the focusing and the stabiliser of single photographs
  KnotGrid grid;
  /// Covariance of sheet and knots: the inverse of the normal equations, for residuals of the
  /// observed size.
  Eigen::MatrixXd covariance;
  std::array<Estimate, 3> colour_gap;  ///< gap of red, green and blue light, mm
  std::vector<PhotoFit> photos;
  /// Fits in which the hand may have turned much during one photograph; those that converged.
  std::vector<TurnedFit> turned;
};

/// TurnedFit is a fit with a free rotation of the hand during one photograph.
struct TurnedFit {
  size_t photo = 0;      ///< index of that photograph
  double radians = 0.0;  ///< rotation from the first row read to the last
  /// Logarithm of the Bayes factor: how much likelier the photographs are if the hand may have
  /// moved than if it held still.
  double evidence = 0.0;
  PhoneFit fit;  ///< without turned fits
};

/// PlausibleFit returns whether a fit that is not finished may still become a good one.
using PlausibleFit = std::function<bool(const PhoneFit&)>;

/// Fits two or more photographs, all measured without refusal and of equal size. The unknowns are
/// the focal length (prior `focal_px`, in averaged pixels), the principal point, two radial terms,
/// a smooth warp of all pictures; for each photograph its pose, its focus breathing, its shift by
/// the stabiliser, its rotation while the rows were read, and the enlargement of its tags; the
/// sheet and its residual map. A knot far from all fringes continues the map straight. The whole
/// lenses between photographs follow from the gap, searched within 30 % of the start. Returns
/// nothing if the fit does not converge. Fits that are not plausible end early, without turned
/// fits.
///
/// The photographs' light is the mean of the channels, but `values` has the gap of green light: a
/// rig's colours are those of its panel, and the sheet refracts them differently.
[[nodiscard]] std::optional<PhoneFit> fit_phone(const std::vector<PhotoFindings>& photos,
                                                const SinglePhotoChart& chart,
                                                const Estimate& focal_px,
                                                const PlausibleFit& plausible = nullptr);

/// MistakeKind is what one photograph may have that the others do not: a phone that turned while
/// the rows were read, another axis, another focal length, a sheet that had moved.
enum class MistakeKind { Turn, Axis, Focal, Sheet };

/// Explanation is a mistake in one photograph that would explain a contradiction.
struct Explanation {
  MistakeKind kind = MistakeKind::Axis;
  size_t photo = 0;       ///< index
  double size = 0.0;      ///< magnitude: radians; longer sides; relative; lenses
  double evidence = 0.0;  ///< logarithm of the Bayes factor against no mistake (Laplace)
};

/// Fits the photographs once more for each mistake in each photograph. Returns the explanations,
/// the likeliest first; none if no fit converges. With `only`, mistakes are in that photograph,
/// and their evidence is relative to each other. Other arguments as for fit_phone().
[[nodiscard]] std::vector<Explanation> explain_contradiction(
    const std::vector<PhotoFindings>& photos, const SinglePhotoChart& chart,
    const Estimate& focal_px, std::optional<size_t> only = std::nullopt);

// Judges whether the hand turned while a photograph was read. As the rows are read one after the
// other, a rotation looks like a shift of the camera's axis and a step to the side: few photographs
// leave open which it was.

/// Returns the fit of the photograph during which the hand moved most evidently, if that changes
/// the phases that the eyes see; nullptr if no hand moved. `start` gives panel and layout.
///
/// Lifetime: the result belongs to the fit.
[[nodiscard]] const TurnedFit* moved_hand(const PhoneFit& fit, const optics::Rig& start,
                                          const std::vector<Vec3>& eyes);

/// Returns the fit with a hand that moved of which the result is least sure: its probability times
/// the change of a phase is largest, and too large to accept; else nullptr. `mean` is that of
/// averaged_over_turns(). More than kFewPhotos photographs leave no such doubt.
///
/// Lifetime: the result belongs to `fit`.
[[nodiscard]] const TurnedFit* possibly_moved_hand(const PhoneFit& fit, const PhoneFit& mean,
                                                   const optics::Rig& start,
                                                   const std::vector<Vec3>& eyes);

/// Returns the mean of the fit and of those with a hand that moved, by their probabilities. Their
/// differences add to the covariance. `photos` is that of the fit. More than kFewPhotos photographs
/// determine rotations; their fit is returned unchanged.
[[nodiscard]] PhoneFit averaged_over_turns(const PhoneFit& fit);

}  // namespace lenticule::calib
