// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

#include "base/statistics.h"
#include "calib/fit/joint_fit.h"
#include "calib/fit/own_cameras.h"
#include "calib/fit/prediction.h"
#include "calib/measure/mark_moves.h"

namespace lenticule::calib {
namespace {

constexpr double kMostRmsLenses = 0.05;     ///< phase residual: above this, no model of this sheet
constexpr double kMostGeometryPart = 1e-3;  ///< geometry residual, relative to the panel's width
constexpr double kLeastCovered = 0.55;      ///< fraction of the panel, in each viewpoint
constexpr double kMostDriftLenses = 0.05;   ///< drift between first and repeated fringes
constexpr double kNotableDriftLenses = 0.003;  ///< more than the noise of any usable camera
constexpr double kLeastWhite = 0.1;            ///< light of the white panel, relative to full scale
constexpr double kMaxPriorSigmas = 4.0;        ///< deviation from prior knowledge
constexpr double kMostCorrelation = 0.98;      ///< correlation of pitch and gap
constexpr double kLeastColourContrast =
    0.85;  ///< contrast of red and blue fringes relative to green
constexpr double kNearestPart =
    0.75;                        ///< nearest possible eyes, relative to the viewpoints' distance
constexpr size_t kMostGaps = 3;  ///< gaps that are fitted if the camera differs from view to view
/// Ratio of costs up to which noise alone explains that cameras differ: simulated noise gives at
/// most 1.009, a shift by 0.1 % of the picture 1.04.
constexpr double kNoise = 1.015;
constexpr int kRoundsForSuspects = 12;  ///< a view that is no suspect converges slowly
constexpr double kAboutAsGood = 1.03;   ///< ratio of costs
/// A single viewpoint shows its distance badly, because the gap is unknown: known distances are
/// compared with this standard error, as a part of the distance, and then held.
constexpr double kSinglePart = 0.025, kHeldMm = 0.1;
constexpr double kAmbiguity = 60.0;  ///< chi-squared by which the best gap must lead
/// Wide patterns are decoded through a smooth map, so their errors are correlated and their many
/// points count as few.
constexpr double kGeometryScatter = 4.0;
/// Remaining aberrations of real lenses beyond the two parameters that the fit has for them: the
/// scatter of `lenticule bench calibrate` beyond that of noise (docs/panel/calibration.md).
constexpr LawError kTracedLenses{
    .pitch_lenses = 0.0005, .slant_lenses = 0.00012, .gap_part = 0.0008};
/// Range of fringe aberrations of lenses on the viewer's side, with a margin; fitted values are
/// compared with three standard errors.
constexpr double kLeastAberration = -0.03;
constexpr double kMostAberration = 0.1;
constexpr double kBgrOffset = 2.0;  ///< subpixels that red and blue are off when swapped

/// Attempt holds the steps of a fit; the steps after a failed one are empty.
struct Attempt {
  std::optional<PoseFit> poses;
  std::optional<GapCandidate> gap;    ///< empty with one view
  std::optional<GapCandidate> rival;  ///< gap that agrees with the views about as well
  std::optional<JointFit> fit;
};

/// Returns true if two values of one quantity agree within their standard errors.
bool agree(const Estimate& a, const Estimate& b) {
  return std::abs(a.value - b.value) <= kMaxPriorSigmas * std::hypot(a.sigma, b.sigma);
}

class Calibrator {
 public:
  Calibrator(const std::vector<ViewpointMeasurement>& viewpoints, const optics::Rig& start,
             const CalibrateOptions& options)
      : measured_(viewpoints),
        panel_(start.panel),
        options_(options),
        start_(sheet_start(start)),
        grid_{options.map_columns, options.map_rows} {
    result_.rig = start;
    start_.gap_tolerance = options.gap_tolerance;
    for (const ViewpointMeasurement& m : viewpoints) views_.push_back(view_of(m, panel_));
  }

  Calibration run() {
    const auto begin = std::chrono::steady_clock::now();
    carry_over();
    if (fit()) {
      put_rig();
      measure_colours();
      evaluate_layout();
      describe_viewpoints();
      describe_parameters();
      leave_one_out();
      predict();
      warn_of_near_eyes();
      evaluate();
    }
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
    result_.seconds_computing = elapsed.count();
    return std::move(result_);
  }

 private:
  [[nodiscard]] bool several() const { return views_.size() > 1; }
  [[nodiscard]] CameraValues camera_in(size_t v) const {
    return camera_of(fit_->values.camera, fit_->values.own[v], views_[v]);
  }
  /// Returns the prediction of the fit. A single viewpoint determines neither pitch nor gap, and
  /// its own picture does not depend on the lens law, so the law's error is omitted.
  [[nodiscard]] Prediction prediction() const {
    return {*fit_, grid_, panel_, several() ? kTracedLenses : LawError{}};
  }

  void refuse(std::string reason) {
    result_.verdict = Verdict::Refused;
    result_.reasons.push_back(std::move(reason));
    refused_ = true;
  }
  void only_effective(std::string reason) { result_.reasons.push_back(std::move(reason)); }

  void carry_over() {
    for (const ViewpointMeasurement& m : measured_) {
      for (const std::string& warning : m.warnings)
        result_.warnings.push_back(fmt::format("{}: {}", m.name, warning));
      if (m.spot) result_.spot = m.spot;
      if (!m.link.findings.empty() || m.spot) result_.link = m.link;
    }
  }

  bool fit();
  [[nodiscard]] JointOptions joint_options() const {
    return {.grid = grid_,
            .free_gap = several(),
            .free_poses = true,
            .geometry_scatter = kGeometryScatter};
  }
  [[nodiscard]] bool is_flat(const JointFit& fit) const {
    return fit.geometry_rms_px <= kMostGeometryPart * panel_.width_px;
  }
  [[nodiscard]] Attempt attempt(CameraSameness sameness) const;
  [[nodiscard]] std::vector<Suspect> suspects(const Attempt& nearly) const;
  [[nodiscard]] Attempt with_own_cameras(const Attempt& same) const;
  [[nodiscard]] Attempt best_attempt();
  void use_distances();
  void put_rig();
  void measure_colours();
  void evaluate_layout();
  [[nodiscard]] Estimate channel_offset(int channel) const;
  void describe_viewpoints();
  void describe_parameters();
  void leave_one_out();
  void predict();
  void warn_of_near_eyes();
  void evaluate_aberration();
  void evaluate_moves(const ViewpointMeasurement& measured);
  void evaluate_light(const ViewpointMeasurement& measured);
  void evaluate_focal_length();
  void evaluate();
  void evaluate_viewpoint(const Viewpoint& viewpoint, const ViewpointMeasurement& measured);

  const std::vector<ViewpointMeasurement>& measured_;
  const optics::Panel& panel_;
  CalibrateOptions options_;
  SheetStart start_;
  KnotGrid grid_;
  std::vector<View> views_;
  std::optional<PoseFit> poses_;
  std::optional<GapCandidate> gap_;
  std::optional<JointFit> fit_;
  CameraSameness sameness_ = CameraSameness::Same;
  bool contradicts_ = false;  ///< true if a camera differs more than the fit can take into account
  bool refused_ = false;
  Calibration result_;
};

/// Replaces the starting pitch, which only served to find fringes, by the pitch of the observed
/// fringes.
void start_from(const ViewpointMeasurement& seen, SheetStart& start, const optics::Panel& panel) {
  start.values[kAcross] = 0.5 * panel.width_px * seen.line.per_px_x;
  start.values[kDown] = 0.5 * panel.height_px * seen.line.per_px_y;
}

/// Searches poses and gaps twice: a wrong gap puts the camera at a slightly wrong distance.
Attempt Calibrator::attempt(CameraSameness sameness) const {
  Attempt out;
  SheetParameters sheet = start_.values;
  out.poses = fit_poses(views_, sheet, panel_, sameness);
  if (!out.poses) return out;
  JointOptions options = joint_options();
  options.sameness = sameness;
  if (!several()) {
    out.fit = fit_jointly(views_, *out.poses, start_, std::nullopt, panel_, options);
    return out;
  }
  std::vector<GapCandidate> gaps = search_gaps(views_, *out.poses, start_, panel_);
  if (gaps.empty()) return out;
  sheet[kGap] = gaps.front().gap_mm;
  sheet[kShape] = gaps.front().shape;
  if (std::optional<PoseFit> again = fit_poses(views_, sheet, panel_, sameness)) out.poses = again;
  gaps = search_gaps(views_, *out.poses, start_, panel_);
  if (gaps.empty()) return out;
  out.gap = gaps.front();
  if (gaps.size() > 1 && gaps[1].chi_squared - gaps[0].chi_squared < kAmbiguity)
    out.rival = gaps[1];
  // The search of gaps does not know the shifts of the cameras' axes, which only phases show.
  const size_t tried = sameness == CameraSameness::Same ? 1 : std::min(kMostGaps, gaps.size());
  for (size_t n = 0; n < tried; ++n) {
    std::optional<JointFit> fit = fit_jointly(views_, *out.poses, start_, gaps[n], panel_, options);
    if (!fit || (out.fit && out.fit->cost <= fit->cost)) continue;
    out.fit = std::move(fit);
    out.gap = gaps[n];
  }
  return out;
}

/// Returns the views whose camera alone, if it differs, explains the views about as well as if it
/// differed at each place.
std::vector<Suspect> Calibrator::suspects(const Attempt& nearly) const {
  std::vector<Suspect> all;
  std::vector<double> costs;
  for (size_t v = 0; v < views_.size(); ++v) {
    PoseFit start{.camera = nearly.fit->values.camera,
                  .own = std::vector<OwnCameraValues>(views_.size()),
                  .poses = nearly.fit->values.poses};
    start.own[v] = nearly.fit->values.own[v];
    JointOptions options = joint_options();
    options.sameness = CameraSameness::Nearly;
    options.only_view = v;
    options.most_rounds = kRoundsForSuspects;
    const auto fit = fit_jointly(views_, start, start_, nearly.gap, panel_, options);
    if (!fit) continue;
    all.push_back({views_[v].name, fit->values.own[v]});
    costs.push_back(fit->cost);
  }
  std::vector<Suspect> likely;
  for (size_t n = 0; n < all.size(); ++n)
    if (costs[n] <= kAboutAsGood * std::ranges::min(costs)) likely.push_back(all[n]);
  return likely;
}

/// Returns true if the cameras differ by an amount that matters, and not because of noise.
bool cameras_differ(const Attempt& nearly, const Attempt& same) {
  return nearly.fit && differ_notably(nearly.fit->values.own) &&
         (!same.fit || same.fit->cost > kNoise * nearly.fit->cost);
}

/// Gives each view its own camera. Starts from the fit of one camera, and anew if the cameras
/// differ: then the places and the gap of that fit may be wrong.
Attempt Calibrator::with_own_cameras(const Attempt& same) const {
  Attempt near = same;
  if (same.fit) {
    JointOptions options = joint_options();
    options.sameness = CameraSameness::Nearly;
    near.fit = fit_jointly(views_, *same.poses, start_, same.gap, panel_, options);
    if (near.fit && !cameras_differ(near, same)) return near;
  }
  Attempt anew = attempt(CameraSameness::Nearly);
  return !near.fit || (anew.fit && anew.fit->cost < near.fit->cost) ? anew : near;
}

/// Fits with one camera for all views, unless the views show that it differs.
Attempt Calibrator::best_attempt() {
  Attempt same = attempt(CameraSameness::Same);
  if (!several()) return same;
  Attempt nearly = with_own_cameras(same);
  if (!cameras_differ(nearly, same)) return same;
  sameness_ = CameraSameness::Nearly;
  contradicts_ = contradict(nearly.fit->values.own);
  // Points of a curved panel fit no camera, so that each place seems to have another one.
  if (contradicts_ && is_flat(*nearly.fit)) refuse(sentence_about(suspects(nearly)));
  return nearly;
}

bool Calibrator::fit() {
  if (views_.empty()) {
    refuse("nothing was measured");
    return false;
  }
  start_from(measured_.front(), start_, panel_);
  Attempt found = best_attempt();
  if (!found.poses) {
    refuse(
        "the place of the camera cannot be determined: no place agrees with the panel points it "
        "saw");
    return false;
  }
  poses_ = std::move(found.poses);
  if (several() && !found.gap) {
    refuse("no gap between lenses and pixels agrees with all viewpoints");
    return false;
  }
  gap_ = found.gap;
  if (found.rival && !contradicts_)
    refuse(
        fmt::format("two gaps agree with the viewpoints about equally well: {:.3f} and {:.3f} mm. "
                    "Add a viewpoint at another distance to the side.",
                    gap_->gap_mm, found.rival->gap_mm));
  fit_ = std::move(found.fit);
  if (fit_) use_distances();
  if (!fit_) refuse("the fit does not converge");
  return fit_.has_value();
}

/// Fits again with the measured distances that agree with the fit, and refuses the others.
void Calibrator::use_distances() {
  JointOptions options = joint_options();
  options.sameness = sameness_;
  const Prediction predicted = prediction();
  for (size_t v = 0; v < std::min(views_.size(), options_.distances_mm.size()); ++v) {
    const Estimate& known = options_.distances_mm[v];
    options.distances_mm.emplace_back();
    if (!(known.value > 0.0)) continue;
    Estimate found{fit_->values.poses[v][kPupil + 2], predicted.eye_sigma(v).z};
    if (!several()) found.sigma = std::max(found.sigma, kSinglePart * found.value);
    if (agree(known, found))
      options.distances_mm.back() = {known.value, several() ? known.sigma : kHeldMm};
    else
      refuse(
          fmt::format("{}: the camera is {:.0f} mm from the panel according to the pictures, not "
                      "{:.0f} mm: measure the distance from the panel to the front of the lens, or "
                      "check the panel's size in the rig",
                      views_[v].name, found.value, known.value));
  }
  if (std::ranges::any_of(options.distances_mm, [](const Estimate& e) { return e.value > 0.0; }))
    fit_ = fit_jointly(views_, *poses_, start_, gap_, panel_, options);
}

void Calibrator::put_rig() {
  put_sheet(fit_->values.sheet, grid_, fit_->values.knots, panel_, result_.rig.sheet);
  if (result_.spot && result_.spot->sigma_lenses > 0.0)
    result_.rig.sheet.spot_sigma = Lenses(result_.spot->sigma_lenses);
  const CameraValues& camera = fit_->values.camera;
  result_.camera = {.focal_px = camera[kFocal],
                    .centre_x_px = camera[kCentreX],
                    .centre_y_px = camera[kCentreY],
                    .k1 = camera[kRadial1],
                    .k2 = camera[kRadial2]};
}

/// Returns the mean phase by which a channel's fringes are ahead of green's, in subpixels.
Estimate Calibrator::channel_offset(int channel) const {
  double sum = 0.0, weight = 0.0, square = 0.0;
  for (const ViewpointMeasurement& m : measured_) {
    const std::vector<PhaseBlock>& green = m.blocks[1].blocks;
    const std::vector<PhaseBlock>& other = m.blocks[static_cast<size_t>(channel)].blocks;
    for (size_t n = 0; n < green.size(); ++n) {
      if (green[n].pixels == 0 || other[n].pixels == 0) continue;
      const double ahead = other[n].phase - green[n].phase;
      const double subpixels = (ahead - std::round(ahead)) * m.line.pitch_subpx();
      const double w = green[n].pixels;
      sum += w * subpixels;
      square += w * subpixels * subpixels;
      weight += w;
    }
  }
  if (!(weight > 0.0)) return {};
  const double mean = sum / weight;
  const double blocks = static_cast<double>(views_.front().phases.size() * views_.size());
  return {mean, std::sqrt(std::max(0.0, square / weight - mean * mean) / std::max(1.0, blocks))};
}

/// Detects layouts in which a colour's position varies from pixel to pixel: its fringes blur, and
/// no offset helps.
void Calibrator::evaluate_layout() {
  for (const ViewpointMeasurement& m : measured_) {
    const auto& contrast = m.channel_contrast;
    const double least = std::min(contrast[0], contrast[2]);
    if (!(least > 0.0) || least > kLeastColourContrast * contrast[1]) continue;
    refuse(
        fmt::format("{}: fringes of red or blue have {:.0f} % of the contrast of green ones: these "
                    "subpixels are not where the panel's layout places them",
                    m.name, 100.0 * least / contrast[1]));
    return;
  }
}

void Calibrator::measure_colours() {
  const Estimate red = channel_offset(0), blue = channel_offset(2);
  const double pitch = result_.rig.sheet.pitch.value;
  // Twice a subpixel in either direction: red and blue are swapped. Phases repeat after a pitch.
  const auto apart = [&](double a, double b) {
    const double turns = (a - b) / pitch;
    return std::abs(turns - std::round(turns)) * pitch;
  };
  result_.link.channels_swapped = apart(red.value, kBgrOffset) < 0.6 &&
                                  apart(blue.value, -kBgrOffset) < 0.6 &&
                                  apart(red.value, 0.0) > 0.6;
  if (result_.link.channels_swapped) {
    result_.link.findings.emplace_back(
        "Red and blue are swapped: the panel's subpixels are ordered BGR.");
    return;
  }
  result_.rig.sheet.channel_offset = {Subpixels(red.value), Subpixels(0.0), Subpixels(blue.value)};
  result_.parameters.push_back({"channel_offset_subpx.red", "subpixels", red});
  result_.parameters.push_back({"channel_offset_subpx.blue", "subpixels", blue});
}

/// CellGrid is a grid of cells over which residuals are averaged.
struct CellGrid {
  int columns, rows;
  double least_blocks;  ///< a cell with fewer blocks has no value
};
constexpr CellGrid kPictureCells{48, 27, 1.0};   ///< cells of the report
constexpr CellGrid kEvaluatedCells{12, 7, 4.0};  ///< large enough that noise averages out

/// Returns means over cells of the panel; NaN for cells with too few blocks.
PanelField field_of(const View& view, const PoseValues& pose, const CameraValues& camera,
                    const std::vector<double>& rests, const optics::Panel& panel,
                    const CellGrid& grid) {
  PanelField field{.columns = grid.columns, .rows = grid.rows, .values = {}};
  const auto cells = static_cast<size_t>(field.columns * field.rows);
  std::vector<double> sums(cells, 0.0), counts(cells, 0.0);
  for (size_t n = 0; n < rests.size(); ++n) {
    const Vec2 pixel = view.phases[n].camera_px;
    const auto lens = lens_plane_point(camera.data(), pose.data(), pixel.x, pixel.y);
    const int column = static_cast<int>(panel.x_px(lens.x) / panel.width_px * field.columns);
    const int row = static_cast<int>(panel.y_px(lens.y) / panel.height_px * field.rows);
    if (column < 0 || row < 0 || column >= field.columns || row >= field.rows) continue;
    const auto cell = static_cast<size_t>(row * field.columns + column);
    sums[cell] += rests[n];
    counts[cell] += 1.0;
  }
  for (size_t cell = 0; cell < cells; ++cell)
    field.values.push_back(counts[cell] >= grid.least_blocks
                               ? sums[cell] / counts[cell]
                               : std::numeric_limits<double>::quiet_NaN());
  return field;
}

/// Returns the angle between the camera's axis and the panel's normal.
double tilt_degrees(const PoseValues& pose) {
  const double forward[3] = {0.0, 0.0, 1.0};
  const double back[3] = {-pose[0], -pose[1], -pose[2]};
  double axis[3];
  ceres::AngleAxisRotatePoint(back, forward, axis);
  return std::acos(std::clamp(-axis[2], -1.0, 1.0)) * 180.0 / std::numbers::pi;
}

void Calibrator::describe_viewpoints() {
  const Prediction predicted = prediction();
  for (size_t v = 0; v < views_.size(); ++v) {
    const ViewpointMeasurement& m = measured_[v];
    const PoseValues& pose = fit_->values.poses[v];
    Viewpoint out;
    out.name = m.name;
    out.eye_mm = {pose[kPupil], pose[kPupil + 1], pose[kPupil + 2]};
    out.eye_sigma_mm = predicted.eye_sigma(v);
    if (!several() && !options_.distances_mm.empty())
      out.eye_sigma_mm.z = std::max(out.eye_sigma_mm.z, options_.distances_mm[v].sigma);
    out.tilt_degrees = tilt_degrees(pose);
    const EffectiveLine line = predicted.effective_line(out.eye_mm);
    out.effective_pitch_subpx = line.pitch_subpx;
    out.slant = line.slant;
    out.effective_offset_lenses = line.offset_lenses;
    out.contrast = m.contrast;
    out.covered = m.covered;
    out.blocks = static_cast<int>(views_[v].phases.size());
    double square = 0.0;
    for (const double rest : fit_->rests[v]) {
      square += rest * rest;
      out.max_lenses = std::max(out.max_lenses, std::abs(rest));
    }
    out.rms_lenses = std::sqrt(square / std::max<double>(1.0, out.blocks));
    out.reprojection_rms_px = fit_->geometry_rms_px;
    out.residual = field_of(views_[v], pose, camera_in(v), fit_->rests[v], panel_, kPictureCells);
    result_.viewpoints.push_back(std::move(out));
  }
}

void Calibrator::describe_parameters() {
  const SheetReport report = prediction().sheet_report();
  result_.parameters.insert(result_.parameters.begin(), report.parameters.begin(),
                            report.parameters.end());
  // Correlations of noise alone: they show whether the viewpoints can separate two parameters.
  result_.correlations = Prediction(*fit_, grid_, panel_).sheet_report().correlations;
}

/// Predicts each viewpoint from the others: sheet and map come from the others, the camera's
/// position from the viewpoint's own panel points.
void Calibrator::leave_one_out() {
  if (views_.size() < 3) return;
  const PoseFit all{
      .camera = fit_->values.camera, .own = fit_->values.own, .poses = fit_->values.poses};
  SheetStart start = start_;
  start.values = fit_->values.sheet;
  for (size_t out = 0; out < views_.size(); ++out) {
    std::vector<View> others = views_;
    PoseFit poses = all;
    GapCandidate gap = *gap_;
    const auto at = static_cast<ptrdiff_t>(out);
    others.erase(others.begin() + at);
    poses.own.erase(poses.own.begin() + at);
    poses.poses.erase(poses.poses.begin() + at);
    gap.whole_lenses.erase(gap.whole_lenses.begin() + at);
    for (int& whole : gap.whole_lenses) whole -= out == 0 ? gap_->whole_lenses[1] : 0;
    gap.gap_mm = fit_->values.sheet[kGap];
    gap.shape = fit_->values.sheet[kShape];
    JointOptions options = joint_options();
    options.free_poses = false;
    const std::optional<JointFit> part = fit_jointly(others, poses, start, gap, panel_, options);
    if (!part) {
      refuse(fmt::format("{}: the other viewpoints do not suffice to predict it",
                         result_.viewpoints[out].name));
      continue;
    }
    FitValues values = part->values;
    values.camera = fit_->values.camera;
    const PoseValues& pose = fit_->values.poses[out];
    const PanelField missed =
        field_of(views_[out], pose, camera_in(out),
                 rests_of(views_[out], fit_->values.own[out], pose, values, grid_, panel_), panel_,
                 kEvaluatedCells);
    double worst = 0.0;
    for (const double lenses : missed.values)
      if (std::isfinite(lenses)) worst = std::max(worst, std::abs(lenses));
    result_.viewpoints[out].predicted_lenses = worst;
  }
}

void Calibrator::predict() {
  double distance = 0.0;
  for (const Viewpoint& v : result_.viewpoints) distance += v.eye_mm.z;
  distance /= static_cast<double>(result_.viewpoints.size());
  std::vector<Vec3> eyes;
  if (several()) {
    for (const double part : {kNearestPart, 1.0, 1.25})
      for (const double side : {-1.0, 0.0, 1.0})
        eyes.push_back({side * options_.zone_half_width_mm, 0.0, part * distance});
  } else {
    eyes.push_back(result_.viewpoints.front().eye_mm);
  }
  result_.drift = prediction().worst_drift(eyes);
}

/// Warns of eyes outside the measured angles. Real lenses have aberrations that grow steeply with
/// the angle to the side. The fit covers the observed angles; beyond the steepest one only the law
/// of the chief ray is known.
void Calibrator::warn_of_near_eyes() {
  if (!several()) return;
  const double half_mm = 0.5 * panel_.width_px * panel_.pixel_width.value;
  double steepest = 0.0, distance = 0.0;
  for (const Viewpoint& v : result_.viewpoints) {
    steepest = std::max(steepest, (half_mm + std::abs(v.eye_mm.x)) / v.eye_mm.z);
    distance += v.eye_mm.z / static_cast<double>(result_.viewpoints.size());
  }
  const double nearest_known = (half_mm + options_.zone_half_width_mm) / steepest;
  if (nearest_known > kNearestPart * distance)
    result_.warnings.push_back(
        fmt::format("for eyes {:.0f} mm to the side and nearer than {:.0f} mm the far edge of the "
                    "panel is extrapolated: add a viewpoint there if viewers will be there",
                    options_.zone_half_width_mm, nearest_known));
}

void Calibrator::evaluate_viewpoint(const Viewpoint& viewpoint,
                                    const ViewpointMeasurement& measured) {
  evaluate_light(measured);
  evaluate_moves(measured);
  if (viewpoint.rms_lenses > kMostRmsLenses)
    refuse(fmt::format("{}: the phase residual is {:.3f} lens rms: no lens sheet explains it",
                       viewpoint.name, viewpoint.rms_lenses));
  if (viewpoint.covered < kLeastCovered)
    refuse(fmt::format("{}: only {:.0f} % of the visible part of the panel could be used",
                       viewpoint.name, 100.0 * viewpoint.covered));
  if (measured.drift_lenses > kMostDriftLenses)
    refuse(
        fmt::format("{}: something moved by {:.3f} lens during the measurement: the camera, the "
                    "sheet, or its temperature",
                    viewpoint.name, measured.drift_lenses));
  else if (measured.drift_lenses > kNotableDriftLenses)
    result_.warnings.push_back(
        fmt::format("{}: something moved by {:.3f} lens during the measurement; put the camera on "
                    "a stand for a more exact result",
                    viewpoint.name, measured.drift_lenses));
}

/// Checks the aberration. The fit separates aberration and sheet by the form of the aberration,
/// which is that of lenses on the viewer's side. Another sign or size means another form, and then
/// neither value is right.
void Calibrator::evaluate_aberration() {
  const double found = fit_->values.sheet[kAberration];
  const double variance = fit_->covariance(kAberration, kAberration);
  const double room = 3.0 * std::sqrt(std::max(0.0, variance));
  if (found + room < kLeastAberration || found - room > kMostAberration)
    refuse(fmt::format(
        "seen from the side, the fringes move in a way that lenses on the viewer's side cannot "
        "cause (aberration {:.3f} gaps): check whether the lenses face the panel",
        found));
}

/// Refuses pictures of a place between which the camera or the panel moved: they belong to two
/// viewpoints.
void Calibrator::evaluate_moves(const ViewpointMeasurement& measured) {
  const std::optional<MarkStep> step = find_step(measured.mark_moves);
  if (!step) return;
  refuse(
      fmt::format("{}: {}, or the panel did: from then on the panel is {:.1f} pixels from where it "
                  "was before; photograph this place again",
                  measured.name, moved_between(step->picture), step->length_px));
}

/// Refuses a focal length that contradicts the known one.
void Calibrator::evaluate_focal_length() {
  if (!options_.focal_px) return;
  const Viewpoint& first = result_.viewpoints.front();
  // The relative errors of focal length and distance are equal.
  const double part = first.eye_sigma_mm.z / first.eye_mm.z;
  const double found = result_.camera.focal_px;
  if (agree(*options_.focal_px, {found, part * found})) return;
  refuse(
      fmt::format("the camera's focal length is {:.0f} px according to the pictures, not {:.0f} px",
                  found, options_.focal_px->value));
}

/// Refuses dark pictures. If a white panel is hardly lighter than the camera's noise and code
/// steps, the dark parts of waves are clipped, and they are decoded to wrong positions without
/// visible jumps.
void Calibrator::evaluate_light(const ViewpointMeasurement& measured) {
  if (measured.white_light == 0.0 || measured.white_light >= kLeastWhite) return;
  refuse(
      fmt::format("{}: the white panel gives {:.1f} % of the camera's full scale, {:.0f} % are "
                  "needed: expose longer, or make the panel brighter",
                  measured.name, 100.0 * measured.white_light, 100.0 * kLeastWhite));
}

void Calibrator::evaluate() {
  for (size_t v = 0; v < views_.size(); ++v)
    evaluate_viewpoint(result_.viewpoints[v], measured_[v]);
  if (!contradicts_ && sameness_ == CameraSameness::Nearly)
    for (std::string& note : notes_of(views_, fit_->values.own))
      result_.warnings.push_back(std::move(note));
  evaluate_focal_length();
  if (!is_flat(*fit_))
    refuse(
        fmt::format("the panel points deviate from a flat panel by {:.1f} pixels: check whether "
                    "the panel is curved, or the camera zoomed between the viewpoints",
                    fit_->geometry_rms_px));
  if (result_.link.chroma_subsampled || result_.link.scaled)
    refuse("the link or the panel alters single subpixels (see the link check)");
  if (result_.link.channels_swapped)
    refuse("the panel's subpixels are ordered BGR: set layout = \"bgr\" in the rig and start over");
  evaluate_aberration();
  for (const Viewpoint& viewpoint : result_.viewpoints)
    if (!contradicts_ && viewpoint.predicted_lenses > options_.most_held_out_lenses)
      refuse(fmt::format("{}: the other viewpoints predict its phase only to {:.3f} lens",
                         viewpoint.name, viewpoint.predicted_lenses));
  if (!several()) {
    only_effective(
        "one viewpoint cannot separate the lens pitch from the gap: valid for this eye only");
  } else {
    if (result_.drift.worst_lenses > options_.most_drift_lenses)
      only_effective(fmt::format(
          "away from the viewpoints the phase may be off by {:.3f} lens: add a viewpoint further "
          "to the side",
          result_.drift.worst_lenses));
    if (views_.size() < 3)
      only_effective(
          "with two viewpoints the prediction for other places cannot be checked: add a third");
    const double correlation = result_.correlations[0][3];
    if (std::abs(correlation) > kMostCorrelation)
      only_effective(
          fmt::format("lens pitch and gap are correlated by {:.3f}: viewpoints further apart would "
                      "separate them",
                      correlation));
  }
  if (refused_) return;
  result_.verdict = result_.reasons.empty() ? Verdict::Intrinsic : Verdict::Effective;
}

}  // namespace

Calibration calibrate(const std::vector<ViewpointMeasurement>& viewpoints, const optics::Rig& start,
                      const CalibrateOptions& options) {
  return Calibrator(viewpoints, start, options).run();
}

}  // namespace lenticule::calib
