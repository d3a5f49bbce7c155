// SPDX-License-Identifier: Apache-2.0
#include "calib/phone/phone_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "base/worker_threads.h"
#include "calib/fit/prediction.h"
#include "calib/fit/projection.h"
#include "calib/phone/phone_fit.h"

namespace lenticule::calib {
namespace {

/// With a limit of 0.0213 lens for 97 of 100 results, 95 are within 0.02.
constexpr double kWantedLenses = 0.0213;
constexpr double kMostPhaseRms = 0.02;  ///< lenses; good photographs have 0.005
constexpr double kMostCornerPx = 2.0;   ///< averaged pixels
constexpr double kMostPull = 4.0;       ///< standard deviations
/// Two stabilisers that shift by 0.3 % to opposite sides are 0.6 % apart.
constexpr double kMostShiftPull = 6.5;
/// Limits of joint_pull(): nearly all good photographs stay below kUsualJointPull; a sheet that
/// moved has 10 to 38, two phones often more than 7.
constexpr double kUsualJointPull = 4.2, kMostJointPull = 7.0;
constexpr double kMostSaturated = 0.1;  ///< clipped fringes seem shifted; usual are 0.002
/// Difference between traced lenses and the law of rigs with the gap and shape that fringes give:
/// 95 of 100 sheets are within this for eyes at tangents up to 1.
constexpr double kLawLenses = 0.006;

std::vector<PhotoFindings> findings_of(const std::vector<PhonePhoto>& photos) {
  std::vector<PhotoFindings> findings;
  for (const PhonePhoto& photo : photos) findings.push_back(photo.findings);
  return findings;
}

void describe(const std::vector<PhonePhoto>& photos, const PhoneFit& fit,
              const Prediction& prediction, Calibration& out) {
  for (size_t n = 0; n < photos.size(); ++n) {
    const PhotoFindings& seen = photos[n].findings;
    const PoseValues& pose = fit.values.poses[n];
    Viewpoint v;
    v.name = photos[n].name;
    v.eye_mm = {pose[kPupil], pose[kPupil + 1], pose[kPupil + 2]};
    v.eye_sigma_mm = fit.photos[n].eye_sigma_mm;
    v.tilt_degrees = seen.pose->tilt_degrees;
    const EffectiveLine line = prediction.effective_line(v.eye_mm);
    v.effective_pitch_subpx = line.pitch_subpx;
    v.slant = line.slant;
    v.effective_offset_lenses = line.offset_lenses;
    v.contrast = seen.contrast;
    v.covered = seen.covered;
    v.blocks = static_cast<int>(seen.blocks.size());
    v.rms_lenses = fit.photos[n].phase_rms;
    for (const double rest : fit.photos[n].phase_rests)
      v.max_lenses = std::max(v.max_lenses, std::abs(rest));
    v.reprojection_rms_px = fit.photos[n].corner_rms_px * seen.averaged;
    v.residual = residual_field(seen.columns, seen.rows, seen.blocks, fit.photos[n].phase_rests);
    out.viewpoints.push_back(v);
  }
  const SheetReport report = prediction.sheet_report();
  out.parameters = report.parameters;
  out.parameters.push_back({"gap_mm.red", "mm", fit.colour_gap[0]});
  out.parameters.push_back({"gap_mm.blue", "mm", fit.colour_gap[2]});
  out.correlations = report.correlations;
  const double averaged = photos.front().findings.averaged;
  const auto& camera = fit.values.camera;
  out.camera = {camera[kFocal] * averaged, camera[kCentreX] * averaged, camera[kCentreY] * averaged,
                camera[kRadial1], camera[kRadial2]};
}

/// Misfit is one kind of contradiction between a photograph and the others.
struct Misfit {
  double excess = 0.0;  ///< relative to the largest value that is accepted
  std::string cause;
};

/// Returns why fringes of the n-th photograph are off: a picture out of focus has less contrast.
std::string cause_of_fringes(const std::vector<PhonePhoto>& photos, size_t n) {
  constexpr double kLeastPart = 0.6;
  const double contrast = photos[n].findings.contrast;
  double usual = 0.0;
  for (const PhonePhoto& photo : photos) usual = std::max(usual, photo.findings.contrast);
  if (contrast < kLeastPart * usual)
    return fmt::format("it was out of focus (contrast {:.2f}, others {:.2f}), or the hand moved",
                       contrast, usual);
  return "the sheet moved on the panel, another chart was shown, or the phone processed the "
         "picture";
}

/// Returns the cause in words, with the number seen.
std::string words_of(const Explanation& cause) {
  switch (cause.kind) {
    case MistakeKind::Turn:
      return fmt::format(
          "the phone turned by {:.2f} degrees while the picture was read: the hand moved; hold the "
          "phone still",
          cause.size * 180.0 / std::numbers::pi);
    case MistakeKind::Axis:
      return fmt::format(
          "its axis seems {:.1f} % of its longer side off that of the others: it was cropped, "
          "mirrored or rotated, or is of another phone",
          100.0 * cause.size);
    case MistakeKind::Focal:
      return fmt::format(
          "its focal length differs by {:.1f} % from that of the others: it was zoomed, cropped or "
          "resized, or is of another lens of the phone",
          100.0 * cause.size);
    case MistakeKind::Sheet:
      return fmt::format("the sheet moved on the panel by {:.2f} lens before it", cause.size);
  }
  return "";
}

/// Returns the worst fault that the tags and fringes of a photograph show.
Misfit worst_misfit(const std::vector<PhonePhoto>& photos, const PhoneFit& fit) {
  Misfit worst;
  for (size_t n = 0; n < photos.size(); ++n) {
    const double corners = fit.photos[n].corner_rms_px, phases = fit.photos[n].phase_rms;
    if (corners / kMostCornerPx > worst.excess)
      worst = {corners / kMostCornerPx,
               fmt::format("{}: its tags are {:.1f} pixels (rms) off: the hand moved, or the phone "
                           "merged several exposures (HDR)",
                           photos[n].name, corners * photos[n].findings.averaged)};
    if (phases / kMostPhaseRms > worst.excess)
      worst = {phases / kMostPhaseRms,
               fmt::format("{}: its fringes are {:.3f} lens (rms) off what the other photographs "
                           "predict: {}",
                           photos[n].name, phases, cause_of_fringes(photos, n))};
  }
  return worst;
}

/// Returns the root of the sum of the squared pulls of all shifts, as for kFewPhotos photographs.
double joint_pull(const PhoneFit& fit) {
  double squares = 0.0;
  for (const PhotoFit& photo : fit.photos) squares += photo.shift_pull * photo.shift_pull;
  const size_t more = std::max(fit.photos.size(), kFewPhotos);
  return std::sqrt(squares * static_cast<double>(kFewPhotos) / static_cast<double>(more));
}

/// Returns how much the cameras of the photographs differ, relative to what is accepted.
double excess_of_cameras(const PhoneFit& fit) {
  double most = 0.0;
  for (const PhotoFit& photo : fit.photos)
    most = std::max({most, photo.breathing_pull / kMostPull, photo.shift_pull / kMostShiftPull});
  return most;
}

constexpr double kClose = 3.0;  ///< evidence: a factor of 20

/// Names the likeliest mistake, and another one that is nearly as likely.
std::string likeliest_mistake(const std::vector<PhonePhoto>& photos,
                              const std::vector<Explanation>& all) {
  if (all.empty()) return "the photographs contradict each other: take all of them again";
  const Explanation& first = all.front();
  std::string out = photos[first.photo].name + ": " + words_of(first);
  const auto other =
      std::ranges::find_if(all, [&](const Explanation& one) { return one.kind != first.kind; });
  if (other != all.end() && other->evidence > first.evidence - kClose)
    out += "; or " + photos[other->photo].name + ": " + words_of(*other);
  return out;
}

/// Determines whether the sheet may have moved before a photograph.
bool may_be_sheet(const std::vector<Explanation>& all) {
  const auto sheet = std::ranges::find(all, MistakeKind::Sheet, &Explanation::kind);
  return sheet != all.end() && sheet->evidence > all.front().evidence - kClose;
}

std::string doubt_of(const TurnedFit& turned, const std::string& photograph) {
  return fmt::format(
      "{}: perhaps the hand moved: the phone seems to have turned by {:.2f} degrees while the "
      "picture was read; take one more from there with the phone held still",
      photograph, turned.radians * 180.0 / std::numbers::pi);
}

bool is_cut(const PhonePhoto& photo) {
  constexpr double kLeastCovered = 0.98;
  return photo.findings.covered < kLeastCovered;
}

/// Determines whether a result depends on photographs of a part of the chart: where fewer than
/// three show the panel, the map follows the error of each, and the stated error does not know it.
bool depends_on_cut(const std::vector<PhonePhoto>& photos) {
  const auto cut = static_cast<size_t>(std::ranges::count_if(photos, is_cut));
  return cut > 0 && photos.size() - cut < kFewPhotos;
}

/// Returns a request to repeat a photograph that shows only a part of the chart; empty if none
/// does.
std::string cut_chart(const std::vector<PhonePhoto>& photos) {
  const auto cut = std::ranges::find_if(photos, is_cut);
  if (cut == photos.end()) return "";
  return fmt::format(
      "{} shows {:.0f} % of the chart; take it again with the whole panel in the picture",
      cut->name, 100.0 * cut->findings.covered);
}

/// JointResult is the fit of some photographs, and whether they agree.
struct JointResult {
  std::optional<PhoneFit> fit;  ///< none if it did not converge
  bool agrees = false;
  /// Which photograph contradicts the others, and why. Empty if the cause is still to be searched.
  std::string cause;
};

/// Photographs of which more than kFewPhotos contradict each other are fitted only until that is
/// evident, and so are `some` of them.
JointResult fit_jointly(const std::vector<PhonePhoto>& photos, const SinglePhotoChart& chart,
                        const Estimate& focal_px, bool some = false) {
  const PlausibleFit plausible = [&photos](const PhoneFit& fit) {
    constexpr double kEvident = 2.0;
    return worst_misfit(photos, fit).excess < kEvident && excess_of_cameras(fit) < kEvident &&
           joint_pull(fit) < kEvident * kMostJointPull;
  };
  const bool ends_early = some || photos.size() > kFewPhotos;
  JointResult out{
      .fit = fit_phone(findings_of(photos), chart, focal_px, ends_early ? plausible : nullptr),
      .cause = "no sheet and no camera agree with all photographs"};
  if (!out.fit) return out;
  const Misfit worst = worst_misfit(photos, *out.fit);
  const bool fits = worst.excess <= 1.0;
  out.cause = fits || excess_of_cameras(*out.fit) > worst.excess ? "" : worst.cause;
  // A part of the chart leaves shifts and rotations too uncertain to blame one.
  out.agrees = fits && excess_of_cameras(*out.fit) <= 1.0 &&
               (depends_on_cut(photos) ||
                (joint_pull(*out.fit) <= kMostJointPull &&
                 moved_hand(*out.fit, chart.start, zone_of(chart.start)) == nullptr));
  return out;
}

void set_aside(const PhonePhoto& photo, const std::string& reason, Calibration& out) {
  out.set_aside.push_back({photo.name, reason});
  out.warnings.push_back(photo.name + ": not used: " + reason);
}

/// Sets the one photograph aside without which all others agree, and returns true. Else, if there
/// is none or several, names the cause of the contradiction. The rest of kFewPhotos could not
/// contradict each other. Three may hide that the sheet moved between them, so that they do not
/// accuse the fourth of that.
bool set_odd_aside(std::vector<PhonePhoto>& photos, const SinglePhotoChart& chart,
                   const Estimate& focal_px, JointResult& joint, Calibration& out) {
  std::vector<JointResult> rests(photos.size() > kFewPhotos ? photos.size() : 0);
  WorkerThreads(0).run(static_cast<int>(rests.size()), [&](int n, int /*worker*/) {
    std::vector<PhonePhoto> others = photos;
    others.erase(others.begin() + n);
    rests[static_cast<size_t>(n)] = fit_jointly(others, chart, focal_px, true);
  });
  std::optional<size_t> odd;
  size_t agreeing = 0;
  JointResult others;
  for (size_t n = 0; n < rests.size(); ++n)
    if (rests[n].agrees && ++agreeing == 1) {
      odd = n;
      others = std::move(rests[n]);
    }
  if (agreeing > 1) odd.reset();
  if (!odd && (!joint.fit || !joint.cause.empty())) return false;
  const std::vector<Explanation> causes =
      explain_contradiction(findings_of(photos), chart, focal_px, odd);
  const std::string begin = odd ? photos[*odd].name + ": " : "";
  if (!odd || !joint.cause.starts_with(begin)) joint.cause = likeliest_mistake(photos, causes);
  if (!odd || (photos.size() <= kFewPhotos + 1 && may_be_sheet(causes))) return false;
  set_aside(photos[*odd],
            joint.cause.starts_with(begin) ? joint.cause.substr(begin.size()) : joint.cause, out);
  photos.erase(photos.begin() + static_cast<ptrdiff_t>(*odd));
  joint = std::move(others);
  return true;
}

/// Returns the component of the panel's x axis along the picture's rows.
double panel_axis_x(const PoseValues& pose) {
  constexpr double kAxis[3] = {1.0, 0.0, 0.0};
  double in_camera[3];
  ceres::AngleAxisRotatePoint(pose.data(), kAxis, in_camera);
  return in_camera[0];
}

/// Returns true if photographs are frames of a film.
bool is_film(const std::vector<PhonePhoto>& photos) {
  return std::ranges::any_of(
      photos, [](const PhonePhoto& photo) { return photo.findings.motion.has_value(); });
}

/// Determines whether a phone shifted many frames of a film to steady the picture.
bool is_stabilised(const PhoneFit& fit) {
  constexpr double kShifted = 3.0;  // standard deviations
  const auto shifted = std::ranges::count_if(
      fit.photos, [](const PhotoFit& frame) { return frame.shift_pull > kShifted; });
  return 3 * static_cast<size_t>(shifted) >= fit.photos.size();
}

/// Returns what another photograph should be like: one instead of a cut one, one from each place,
/// then one with the phone the other way up. At the sides the phone should be raised: seen at an
/// angle from above, the panel shows a shift of the axis to the side, which would otherwise look
/// like a step.
std::string wanted(const std::vector<PhonePhoto>& photos, const PhoneFit& fit) {
  if (is_film(photos))
    return "film again, from a step at the upper left, past the middle, to the upper right";
  if (std::string again = cut_chart(photos); !again.empty()) return again;
  constexpr std::array<const char*, 3> kPlaces = {"upper left", "middle", "upper right"};
  constexpr double kAside = 0.25;
  std::array<std::array<bool, 2>, 3> seen{};
  bool turned = false;
  for (const PoseValues& pose : fit.values.poses) {
    const double aside = pose[kPupil] / pose[kPupil + 2];
    // The panel's x axis points to the left in a picture that is upside down.
    const bool other = panel_axis_x(pose) * panel_axis_x(fit.values.poses.front()) < 0.0;
    seen[aside < -kAside ? 0 : aside > kAside ? 2 : 1][other ? 1 : 0] = true;
    turned = turned || other;
  }
  for (const size_t place : {1, 0, 2})
    if (!seen[place][0] && !seen[place][1])
      return std::string("take one more from the ") + kPlaces[place];
  if (!turned) return "take one more from the middle with the phone upside down";
  for (const size_t place : {2, 0, 1})
    if (!seen[place][0] || !seen[place][1])
      return std::string("take one more from the ") + kPlaces[place] +
             " with the phone the other way up";
  return "take one more from another place";
}

/// Returns the photographs without refusal that have the most frequent size. Adds warnings of the
/// others, and why there is no fit.
std::vector<PhonePhoto> usable_photos(const std::vector<PhonePhoto>& photos, Calibration& out) {
  using Size = std::pair<int, int>;
  const auto size_of = [](const PhonePhoto& photo) {
    return Size(photo.findings.width, photo.findings.height);
  };
  std::map<Size, int> sizes;
  Size usual;
  for (const PhonePhoto& photo : photos)
    if (!photo.findings.refusal.empty())
      out.warnings.push_back(photo.name + ": not used: " + photo.findings.refusal);
    else if (++sizes[size_of(photo)] > sizes[usual])
      usual = size_of(photo);
  std::vector<PhonePhoto> usable;
  for (const PhonePhoto& photo : photos)
    if (size_of(photo) == usual && photo.findings.refusal.empty())
      usable.push_back(photo);
    else if (photo.findings.refusal.empty())
      set_aside(photo,
                "another size than the other photographs: give the files of one phone, as it "
                "stored them",
                out);
  if (usable.size() < 2) {
    out.reasons.push_back(fmt::format("only {} of {} photographs can be used; two are needed",
                                      usable.size(), photos.size()));
    for (const std::string& warning : out.warnings) out.reasons.push_back(warning);
  }
  return usable;
}

/// Writes the rig of a fit, its stated error and its description.
void set_result(const std::vector<PhonePhoto>& photos, const PhoneFit& fit,
                const optics::Rig& start, Calibration& out) {
  JointFit spread;
  spread.values = fit.values;
  spread.covariance = fit.covariance;
  constexpr LawError kLaw{.pitch_lenses = 0.0005, .slant_lenses = 0.0002, .gap_part = 0.0008};
  const Prediction prediction(spread, fit.grid, start.panel, kLaw);
  set_sheet(fit.values.sheet, fit.grid, fit.values.knots, start.panel, out.rig.sheet);
  describe(photos, fit, prediction, out);
  out.drift = prediction.likely_largest_drift(zone_of(start));
  // Shifts that are larger than their prior says make all errors larger. Two photographs leave the
  // fit so much freedom that their residuals are too small.
  const double larger =
      std::max(photos.size() < kFewPhotos ? 1.4 : 1.0, joint_pull(fit) / kUsualJointPull);
  out.drift.worst_lenses = std::hypot(larger * out.drift.worst_lenses, kLawLenses);
}

/// Accepts photographs without a contradiction if they determine the sheet; else adds the reason.
void evaluate_error(const std::vector<PhonePhoto>& photos, const PhoneFit& fit,
                    const PhoneFit& mean, const optics::Rig& start, Calibration& out) {
  if (out.drift.worst_lenses > kWantedLenses) {
    out.reasons.push_back(fmt::format(
        "phases are certain only to {:.3f} lens, {} {} are not enough: {}", out.drift.worst_lenses,
        photos.size(), is_film(photos) ? "frames" : "photographs", wanted(photos, mean)));
  } else if (depends_on_cut(photos)) {
    out.reasons.push_back(cut_chart(photos));
  } else if (const TurnedFit* turned = possibly_moved_hand(fit, mean, start, zone_of(start))) {
    out.reasons.push_back(doubt_of(*turned, photos[turned->photo].name));
  } else {
    out.verdict = Verdict::Intrinsic;
    if (photos.size() <= kFewPhotos)
      out.warnings.push_back(
          fmt::format("{} photographs do not show whether the sheet moved between them: {}",
                      photos.size(), wanted(photos, mean)));
  }
}

}  // namespace

PhotoFindings measure_hand_held(const CameraPicture& photograph, const SinglePhotoChart& chart,
                                const Estimate& focal_px, bool only_tags) {
  const double distance = viewing_distance_mm(chart.start);
  PhotoPriors priors;
  priors.focal_px = focal_px;
  priors.distance_mm = Estimate{distance, 0.3 * distance};
  PhotoFindings findings = measure_photo(photograph, chart, priors, only_tags);
  if (findings.refusal.empty() && findings.saturated > kMostSaturated)
    findings.refusal =
        fmt::format("{:.0f} % of the fringes are clipped: expose less, or darken the room",
                    100.0 * findings.saturated);
  return findings;
}

std::optional<optics::Rig> better_start(const PhotoFindings& seen, const SinglePhotoChart& chart) {
  constexpr double kMostOff = 0.01;
  const optics::LensSheet &start = chart.start.sheet, &found = seen.rig.sheet;
  if (!seen.refusal.empty() || std::abs(found.pitch.value / start.pitch.value - 1.0) <= kMostOff)
    return std::nullopt;
  optics::Rig better = chart.start;
  better.sheet.pitch = found.pitch;
  better.sheet.slant = found.slant;
  if (!has_room_for_tags(better)) return std::nullopt;
  return better;
}

Calibration calibrate_phone(const std::vector<PhonePhoto>& photos, const SinglePhotoChart& chart,
                            const Estimate& focal_px, double most_lenses) {
  const auto began = std::chrono::steady_clock::now();
  Calibration out;
  out.rig = chart.start;
  std::vector<PhonePhoto> usable = usable_photos(photos, out);
  if (!out.reasons.empty()) return out;
  const double averaged = usable.front().findings.averaged;
  const Estimate focal{focal_px.value / averaged, focal_px.sigma / averaged};
  JointResult joint = fit_jointly(usable, chart, focal);
  if (is_film(usable) && joint.fit && !joint.agrees && is_stabilised(*joint.fit)) {
    out.reasons.emplace_back(
        "the phone shifted the pictures of the film to steady them: switch video stabilisation off "
        "and film again");
    return out;
  }
  while (!joint.agrees && set_odd_aside(usable, chart, focal, joint, out)) continue;
  if (!joint.fit) {
    out.reasons.push_back(joint.cause);
    return out;
  }
  const PhoneFit mean = averaged_over_turns(*joint.fit);
  set_result(usable, mean, chart.start, out);
  out.seconds_computing =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  if (!joint.agrees) {
    out.reasons.push_back(joint.cause);
    return out;
  }
  if (const auto problem = optics::find_problem(out.rig)) {
    out.reasons.push_back(problem->key + " would be " + problem->cause);
    return out;
  }
  evaluate_error(usable, *joint.fit, mean, chart.start, out);
  if (out.verdict == Verdict::Refused && out.drift.worst_lenses <= most_lenses)
    out.verdict = Verdict::Effective;
  return out;
}

}  // namespace lenticule::calib
