// SPDX-License-Identifier: Apache-2.0
#include "calib/report/report_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace lenticule::calib {
namespace {

bool any_contrast_below(const Calibration& calibration, double wanted) {
  return std::any_of(calibration.viewpoints.begin(), calibration.viewpoints.end(),
                     [&](const Viewpoint& v) { return v.contrast > 0.0 && v.contrast < wanted; });
}

void add_link_advice(const LinkCheck& link, std::vector<std::string>& out) {
  if (link.scaled)
    out.emplace_back(
        "Show the panel's own resolution and switch off overscan and zoom: the picture is being "
        "scaled, so that no subpixel is in its place.");
  if (link.chroma_subsampled)
    out.emplace_back(
        "Set the input of the television to PC or to RGB 4:4:4: colour arrives at half resolution, "
        "so that red and blue cannot be controlled separately.");
  if (link.channels_swapped)
    out.emplace_back(
        "Write layout = \"bgr\" into the rig and calibrate again: red and blue stripes are "
        "swapped.");
}

void add_measurement_advice(const Calibration& calibration, std::vector<std::string>& out) {
  if (any_contrast_below(calibration, kWantedContrast))
    out.emplace_back(
        "Look at the sheet: the fringes are weak. It may be loose or upside down, be covered by "
        "dust or a film, or the camera's aperture may be too wide.");
  const ResidualSummary used = residual_summary(calibration, false);
  if (used.max_lenses > kWantedMaxLenses || used.rms_lenses > kWantedRmsLenses)
    out.emplace_back(
        "Look at the maps of residuals: patches suggest bubbles or a bent sheet, slopes suggest a "
        "camera that moved or a sheet that was still warming up.");
  if (residual_summary(calibration, true).max_lenses > kWantedHeldOutMaxLenses)
    out.emplace_back(
        "Measure again from more places: the one kept aside is predicted too badly to trust places "
        "that were not measured.");
}

std::string place_of_first_eye(const Calibration& calibration) {
  for (const Viewpoint& v : calibration.viewpoints)
    if (!v.held_out)
      return fmt::format("{:.0f} mm from the panel, {:.0f} mm right and {:.0f} mm above its centre",
                         v.eye_mm.z, v.eye_mm.x, v.eye_mm.y);
  return "the place it was measured from";
}

void add_verdict_advice(const Calibration& calibration, std::vector<std::string>& out) {
  switch (calibration.verdict) {
    case Verdict::Intrinsic:
      out.emplace_back(
          "Use the rig. If the picture drifts as the panel warms up, trim offset and pitch while "
          "it plays; calibrate again after the sheet was taken off or pressed on.");
      return;
    case Verdict::Effective:
      out.emplace_back(
          fmt::format("Use the rig for viewers near {}.", place_of_first_eye(calibration)));
      out.emplace_back(
          "For viewers elsewhere, calibrate again with the camera also 200 to 300 mm to the left "
          "and to the right, or a third nearer.");
      return;
    case Verdict::Refused:
      out.emplace_back("Do not use these numbers; the previous rig file is still the best one.");
      out.emplace_back(
          "Remove the causes above and calibrate again, in a dark room with the camera on a "
          "tripod.");
  }
}

std::string side(double share, const char* low, const char* high) {
  if (share < 1.0 / 3.0) return low;
  return share > 2.0 / 3.0 ? high : "";
}

}  // namespace

std::string verdict_headline(Verdict verdict) {
  switch (verdict) {
    case Verdict::Intrinsic:
      return "Calibrated";
    case Verdict::Effective:
      return "Calibrated for one viewing position";
    case Verdict::Refused:
      return "Not calibrated";
  }
  return "Not calibrated";
}

std::string verdict_explained(const Calibration& calibration) {
  switch (calibration.verdict) {
    case Verdict::Intrinsic:
      return "The numbers describe the sheet itself and are valid for every eye in front of it.";
    case Verdict::Effective:
      return "The numbers are valid at " + place_of_first_eye(calibration) +
             ". Pitch, gap and offset could not be separated.";
    case Verdict::Refused:
      return "The measurement is not good enough to be used.";
  }
  return {};
}

std::vector<std::string> advice(const Calibration& calibration) {
  std::vector<std::string> out;
  add_link_advice(calibration.link, out);
  add_measurement_advice(calibration, out);
  add_verdict_advice(calibration, out);
  return out;
}

std::string panel_place(const optics::Panel& panel, double x_px, double y_px) {
  const std::string across = side(x_px / std::max(panel.width_px, 1), "left", "right");
  const std::string down = side(y_px / std::max(panel.height_px, 1), "top", "bottom");
  if (across.empty() && down.empty()) return "centre";
  return down + (across.empty() || down.empty() ? "" : " ") + across;
}

std::string with_error(const Estimate& estimate) {
  if (!std::isfinite(estimate.value)) return "not known";
  if (!(std::isfinite(estimate.sigma) && estimate.sigma > 0.0))
    return fmt::format("{:.6g}", estimate.value);
  const double first_digit = std::floor(std::log10(estimate.sigma));
  const int digits = static_cast<int>(std::clamp(1.0 - first_digit, 0.0, 12.0));
  return fmt::format("{:.{}f} \u00b1 {:.{}f}", estimate.value, digits, estimate.sigma, digits);
}

ResidualSummary residual_summary(const Calibration& calibration, bool held_out) {
  ResidualSummary summary;
  double squares = 0.0;
  for (const Viewpoint& v : calibration.viewpoints) {
    if (v.held_out != held_out) continue;
    ++summary.viewpoints;
    squares += v.rms_lenses * v.rms_lenses;
    summary.max_lenses = std::max(summary.max_lenses, v.max_lenses);
  }
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (summary.viewpoints == 0) return {0, kNone, kNone};
  summary.rms_lenses = std::sqrt(squares / summary.viewpoints);
  return summary;
}

}  // namespace lenticule::calib
