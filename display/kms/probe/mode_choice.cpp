// SPDX-License-Identifier: Apache-2.0
#include "display/kms/probe/mode_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace lenticule::display {
namespace {

// A request for 60 matches 59.997 and does not match 59.94.
constexpr double kRefreshTolerance = 0.0005;

PixelSize size_of(const drmModeModeInfo& mode) {
  return {mode.hdisplay, mode.vdisplay};
}

PixelSize size_of(const frames::FrameGeometry& panel) {
  return {panel.width, panel.height};
}

double relative_error(const drmModeModeInfo& mode, frames::Rate refresh) {
  return std::abs(refresh_of(mode).hertz() / refresh.hertz() - 1.0);
}

/// Returns true if `a` is the better choice. If both are equally good, the one with the lower pixel
/// clock is better: it needs less link bandwidth, and is rarely a television timing with a limited
/// range of values.
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

std::optional<drmModeModeInfo> best_of_size(const std::vector<drmModeModeInfo>& modes,
                                            PixelSize size, std::optional<frames::Rate> refresh) {
  std::optional<drmModeModeInfo> best;
  for (const drmModeModeInfo& mode : modes) {
    if (size_of(mode) != size || !is_plain(mode)) continue;
    if (refresh && relative_error(mode, *refresh) > kRefreshTolerance) continue;
    if (!best || better(mode, *best, refresh)) best = mode;
  }
  return best;
}

std::string text_of(PixelSize size) {
  return fmt::format("{}x{}", size.width, size.height);
}

[[noreturn]] void throw_not_listed(const ConnectorInfo& connector, PixelSize size,
                                   std::optional<frames::Rate> refresh) {
  std::string wanted = text_of(size);
  if (refresh) wanted += fmt::format("@{}", frames::to_string(*refresh));
  std::string text = fmt::format("{}: no progressive mode {}; it has", connector.name, wanted);
  for (const drmModeModeInfo& mode : connector.modes) text += fmt::format(" {}", to_string(mode));
  if (connector.modes.empty()) text += " none";
  throw Error(ErrorKind::Input, text,
              "woven frames fit one panel, pixel for pixel: use this panel's own rig");
}

[[noreturn]] void throw_not_native(const ConnectorInfo& connector, PixelSize size) {
  std::string own;
  for (const PixelSize native : native_sizes(connector))
    own += (own.empty() ? "" : " or ") + text_of(native);
  throw Error(ErrorKind::Input,
              fmt::format("{}: the panel would scale {} to its own {}, and no view would arrive",
                          connector.name, text_of(size), own),
              "use this panel's own rig; where its EDID states a wrong size, load a right one "
              "(drm.edid_firmware=)");
}

}  // namespace

std::vector<PixelSize> native_sizes(const ConnectorInfo& connector) {
  if (connector.edid.problem != EdidProblem::None) return {};
  std::vector<PixelSize> sizes;
  for (const drmModeModeInfo& mode : connector.modes)
    if (is_preferred(mode) && std::find(sizes.begin(), sizes.end(), size_of(mode)) == sizes.end())
      sizes.push_back(size_of(mode));
  return sizes.empty() ? connector.edid.native_sizes() : sizes;
}

bool may_be_native(const ConnectorInfo& connector, PixelSize size) {
  const std::vector<PixelSize> native = native_sizes(connector);
  return native.empty() || std::find(native.begin(), native.end(), size) != native.end();
}

bool is_plain(const drmModeModeInfo& mode) {
  return (mode.flags & (DRM_MODE_FLAG_INTERLACE | DRM_MODE_FLAG_DBLSCAN)) == 0 && mode.vscan <= 1 &&
         refresh_of(mode).numerator > 0;
}

bool offers_mode(const ConnectorInfo& connector, const drmModeModeInfo& mode) {
  return may_be_native(connector, size_of(mode)) &&
         std::any_of(connector.modes.begin(), connector.modes.end(),
                     [&](const auto& listed) { return same_timings(listed, mode); });
}

std::optional<drmModeModeInfo> choose_mode(const ConnectorInfo& connector,
                                           const frames::FrameGeometry& panel,
                                           std::optional<frames::Rate> refresh) {
  if (!may_be_native(connector, size_of(panel))) return std::nullopt;
  return best_of_size(connector.modes, size_of(panel), refresh);
}

drmModeModeInfo require_mode(const ConnectorInfo& connector, const frames::FrameGeometry& panel,
                             std::optional<frames::Rate> refresh) {
  if (const auto mode = choose_mode(connector, panel, refresh)) return *mode;
  if (best_of_size(connector.modes, size_of(panel), std::nullopt) &&
      !may_be_native(connector, size_of(panel)))
    throw_not_native(connector, size_of(panel));
  throw_not_listed(connector, size_of(panel), refresh);
}

}  // namespace lenticule::display
