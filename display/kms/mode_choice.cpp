// SPDX-License-Identifier: Apache-2.0
#include "display/kms/mode_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "optics/error.h"

namespace lenticule::display {
namespace {

// 59.997 is meant by 60; 59.94 is not.
constexpr double kRefreshTolerance = 0.0005;

bool one_to_one(const drmModeModeInfo& mode, const frames::FrameGeometry& panel) {
  return mode.hdisplay == panel.width && mode.vdisplay == panel.height &&
         (mode.flags & (DRM_MODE_FLAG_INTERLACE | DRM_MODE_FLAG_DBLSCAN)) == 0 && mode.vscan <= 1 &&
         refresh_of(mode).numerator > 0;
}

double relative_error(const drmModeModeInfo& mode, frames::Rate refresh) {
  return std::abs(refresh_of(mode).hertz() / refresh.hertz() - 1.0);
}

bool is_preferred(const drmModeModeInfo& mode) {
  return (mode.type & DRM_MODE_TYPE_PREFERRED) != 0;
}

/// Whether `a` is the better choice. Of equals the one with the lower pixel clock: it puts less on
/// the link, and is rarely a television timing with a narrowed range of values.
bool better(const drmModeModeInfo& a, const drmModeModeInfo& b,
            std::optional<frames::Rate> refresh) {
  if (refresh) {
    const double difference = relative_error(a, *refresh) - relative_error(b, *refresh);
    if (std::abs(difference) > 1e-9) return difference < 0;
  }
  if (is_preferred(a) != is_preferred(b)) return is_preferred(a);
  const double faster = refresh_of(a).hertz() - refresh_of(b).hertz();
  if (std::abs(faster) > 1e-3) return faster > 0;
  return a.clock < b.clock;
}

}  // namespace

std::optional<drmModeModeInfo> choose_mode(const std::vector<drmModeModeInfo>& modes,
                                           const frames::FrameGeometry& panel,
                                           std::optional<frames::Rate> refresh) {
  std::optional<drmModeModeInfo> best;
  for (const drmModeModeInfo& mode : modes) {
    if (!one_to_one(mode, panel)) continue;
    if (refresh && relative_error(mode, *refresh) > kRefreshTolerance) continue;
    if (!best || better(mode, *best, refresh)) best = mode;
  }
  return best;
}

drmModeModeInfo require_mode(const ConnectorInfo& connector, const frames::FrameGeometry& panel,
                             std::optional<frames::Rate> refresh) {
  if (const auto mode = choose_mode(connector.modes, panel, refresh)) return *mode;
  std::string wanted = fmt::format("{}x{}", panel.width, panel.height);
  if (refresh) wanted += fmt::format("@{}", frames::to_string(*refresh));
  std::string text = fmt::format("{}: no progressive mode {}; it has", connector.name, wanted);
  for (const drmModeModeInfo& mode : connector.modes) text += fmt::format(" {}", to_string(mode));
  if (connector.modes.empty()) text += " none";
  throw Error(ErrorKind::Input, text,
              "woven frames fit one panel, pixel for pixel: use this panel's own rig");
}

}  // namespace lenticule::display
