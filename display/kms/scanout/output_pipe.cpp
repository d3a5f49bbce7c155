// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/output_pipe.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "display/kms/device/drm_handles.h"
#include "display/kms/device/television_modes.h"

namespace lenticule::display {
namespace {

PipeTables read_tables(int fd, const Pipe& pipe) {
  auto tables = PipeTables::read(fd, pipe.connector.id, pipe.crtc, pipe.plane);
  if (tables) return std::move(*tables);
  throw Error(ErrorKind::Device, fmt::format("{}: vanished", pipe.connector.name));
}

BlobId make_mode_blob(int fd, const drmModeModeInfo& mode) {
  uint32_t id = 0;
  const int error = drmModeCreatePropertyBlob(fd, &mode, sizeof(mode), &id);
  if (error != 0)
    throw Error(ErrorKind::Device,
                fmt::format("kms: cannot create a mode: {}", std::strerror(-error)));
  return {fd, id};
}

/// Returns the bits per colour that the panel accepts, as its EDID states them. For an HDMI input,
/// more than 8 bits must be stated by the HDMI data block; the base block alone does not suffice.
std::optional<int> bits_accepted(const ConnectorInfo& connector) {
  const EdidReading& edid = connector.edid;
  if (!edid.identity || !is_hdmi(connector.type)) return edid.bits_per_colour;
  return edid.deep_colour ? 10 : std::min(edid.bits_per_colour.value_or(8), 8);
}

std::optional<int> most_bits(const PropertyTable& connector) {
  const Property* const limit = connector.find("max bpc");
  if (limit == nullptr || !limit->is_range() || limit->maximum == 0) return std::nullopt;
  return static_cast<int>(std::min<uint64_t>(limit->maximum, 64));
}

/// Unlinks the objects other than `except` whose CRTC_ID is `crtc`.
void unlink(std::vector<PropertySetting>& settings, const PropertyTable& table, uint32_t crtc,
            bool is_plane) {
  if (table.value("CRTC_ID") != crtc) return;
  settings.push_back({table.object(), table.require("CRTC_ID"), 0});
  if (is_plane) settings.push_back({table.object(), table.require("FB_ID"), 0});
}

}  // namespace

OutputPipe::OutputPipe(const DrmDevice& device, Pipe pipe, std::shared_ptr<KmsPlatform> platform)
    : device_(device),
      pipe_(std::move(pipe)),
      tables_(read_tables(device_.fd(), pipe_)),
      audit_(tables_, pipe_.depth),
      gamma_(device_.fd(), tables_.crtc),
      mode_blob_(make_mode_blob(device_.fd(), pipe_.mode)),
      framebuffer_property_(tables_.plane.require("FB_ID")),
      platform_(std::move(platform)),
      link_(link_info()),
      place_{.card = device_.path(),
             .connector = pipe_.connector.name,
             .crtc = pipe_.crtc,
             .depth = pipe_.depth} {}

std::vector<PropertySetting> OutputPipe::plane_settings(uint32_t framebuffer) const {
  const PropertyTable& plane = tables_.plane;
  const uint64_t width = pipe_.mode.hdisplay;
  const uint64_t height = pipe_.mode.vdisplay;
  const auto set = [&](const char* name, uint64_t value) {
    return PropertySetting{plane.object(), plane.require(name), value};
  };
  const auto [left, top] = source();
  return {set("FB_ID", framebuffer), set("CRTC_ID", pipe_.crtc), set("SRC_X", left),
          set("SRC_Y", top),         set("SRC_W", width << 16),  set("SRC_H", height << 16),
          set("CRTC_X", 0),          set("CRTC_Y", 0),           set("CRTC_W", width),
          set("CRTC_H", height)};
}

std::vector<PropertySetting> OutputPipe::mode_settings() const {
  const PropertyTable& connector = tables_.connector;
  const PropertyTable& crtc = tables_.crtc;
  std::vector<PropertySetting> settings = {
      {connector.object(), connector.require("CRTC_ID"), pipe_.crtc},
      {crtc.object(), crtc.require("MODE_ID"), mode_blob_.get()},
      {crtc.object(), crtc.require("ACTIVE"), 1}};
  if (const Property* link = connector.find("link-status"))
    if (const auto good = link->value_named("Good"))
      settings.push_back({connector.object(), link->id, *good});
  return settings;
}

std::pair<uint64_t, uint64_t> OutputPipe::source() const {
  return {static_cast<uint64_t>(pipe_.left_px) << 16, static_cast<uint64_t>(pipe_.top_px) << 16};
}

std::vector<PropertySetting> OutputPipe::unlink_settings(
    const std::vector<uint32_t>& except) const {
  const auto stays = [&](uint32_t object) {
    return std::ranges::find(except, object) != except.end();
  };
  std::vector<PropertySetting> settings;
  const int fd = device_.fd();
  const DrmPlanes planes(drmModeGetPlaneResources(fd));
  for (uint32_t i = 0; planes && i < planes->count_planes; ++i) {
    if (stays(planes->planes[i])) continue;
    if (const auto table = PropertyTable::read(fd, planes->planes[i], DRM_MODE_OBJECT_PLANE))
      unlink(settings, *table, pipe_.crtc, true);
  }
  const DrmResources resources(drmModeGetResources(fd));
  for (int i = 0; resources && i < resources->count_connectors; ++i) {
    if (stays(resources->connectors[i])) continue;
    if (const auto table =
            PropertyTable::read(fd, resources->connectors[i], DRM_MODE_OBJECT_CONNECTOR))
      unlink(settings, *table, pipe_.crtc, false);
  }
  return settings;
}

bool OutputPipe::runs_in_mode() const {
  if (tables_.connector.value("CRTC_ID") != pipe_.crtc) return false;
  if (tables_.crtc.value("ACTIVE") != 1 || pipe_.connector.link_bad) return false;
  const DrmCrtc crtc(drmModeGetCrtc(device_.fd(), pipe_.crtc));
  return crtc && crtc->mode_valid != 0 && same_timings(crtc->mode, pipe_.mode);
}

void OutputPipe::remember(uint32_t framebuffer) {
  std::vector<PropertySetting> changes = mode_settings();
  append(changes, plane_settings(framebuffer));
  append(changes, audit_.settings());
  saved_.remember(device_.fd(), changes, {&tables_.connector, &tables_.crtc, &tables_.plane});
}

bool OutputPipe::restore() noexcept {
  const bool ramp_is_back = gamma_.restore() == 0;
  return (saved_.empty() || saved_.restore(device_.fd())) && ramp_is_back;
}

bool OutputPipe::placed_one_to_one(const PipeTables& tables) const {
  const uint64_t width = pipe_.mode.hdisplay;
  const uint64_t height = pipe_.mode.vdisplay;
  const PropertyTable& plane = tables.plane;
  const auto [left, top] = source();
  return plane.value("SRC_X") == left && plane.value("SRC_Y") == top &&
         plane.value("CRTC_X") == 0 && plane.value("CRTC_Y") == 0 &&
         plane.value("SRC_W") == width << 16 && plane.value("SRC_H") == height << 16 &&
         plane.value("CRTC_W") == width && plane.value("CRTC_H") == height;
}

/// Completes an accepted commit: sets the legacy gamma ramp and updates the report.
void OutputPipe::settle() {
  (void)gamma_.make_linear();  // the report states whether it is linear
  update_report(PipeTables::read(device_.fd(), pipe_.connector.id, pipe_.crtc, pipe_.plane));
}

LinkInfo OutputPipe::link_info() const {
  const EdidReading& edid = pipe_.connector.edid;
  const PixelSize size{pipe_.mode.hdisplay, pipe_.mode.vdisplay};
  const std::vector<PixelSize> native = edid.native_sizes();
  return {.connector_type = pipe_.connector.type,
          .driver = device_.driver(),
          .edid_known = edid.identity.has_value(),
          .offers_ycbcr = edid.offers_ycbcr,
          .only_as_420 = is_one_of(pipe_.mode, edid.only_as_420),
          .bits_per_colour = bits_accepted(pipe_.connector),
          .most_bits = most_bits(tables_.connector),
          .depth = pipe_.depth,
          .wanted = pipe_.wanted,
          .other_native_size =
              !native.empty() && std::find(native.begin(), native.end(), size) == native.end(),
          .variable_refresh = pipe_.connector.variable_refresh,
          .one_to_one = std::nullopt};
}

void OutputPipe::update_connector(ConnectorInfo connector) {
  pipe_.connector = std::move(connector);
  LinkInfo info = link_info();
  const std::lock_guard lock(mutex_);
  link_ = std::move(info);
}

ExactnessReport OutputPipe::make_report(const std::optional<PipeTables>& now, AuditDepth depth) {
  LinkInfo link;
  LinkPlace place;
  std::vector<AuditRow> debugfs_rows;
  {
    const std::lock_guard lock(mutex_);
    link = link_;
    place = place_;
    debugfs_rows = debugfs_rows_;
  }
  if (now) link.one_to_one = placed_one_to_one(*now);
  std::vector<AuditRow> further = read_sysfs_rows(*platform_, place);
  if (depth == AuditDepth::Everything) {
    debugfs_rows = read_debugfs_rows(*platform_, place);
    const std::lock_guard lock(mutex_);
    debugfs_rows_ = debugfs_rows;
  }
  further.insert(further.end(), debugfs_rows.begin(), debugfs_rows.end());
  if (const auto ramp = gamma_.row(now.has_value())) further.push_back(*ramp);
  return audit_.report(link, now, further);
}

void OutputPipe::update_report(const std::optional<PipeTables>& now) {
  ExactnessReport report = make_report(now, AuditDepth::Everything);
  const std::lock_guard lock(mutex_);
  report_ = std::move(report);
  ++reports_by_owner_;
}

bool OutputPipe::audit_again(AuditDepth depth) {
  uint64_t before = 0;
  {
    const std::lock_guard lock(mutex_);
    before = reports_by_owner_;
  }
  const auto now = PipeTables::read(device_.fd(), tables_.connector.object(), tables_.crtc.object(),
                                    tables_.plane.object());
  if (!now) return false;  // the connector is gone; the panel's state reports that
  ExactnessReport report = make_report(now, depth);
  const std::lock_guard lock(mutex_);
  if (reports_by_owner_ != before) return false;
  const bool lost = lost_a_setting(report_, report);
  report_ = std::move(report);
  return lost;
}

ExactnessReport OutputPipe::report() const {
  const std::lock_guard lock(mutex_);
  return report_;
}

}  // namespace lenticule::display
