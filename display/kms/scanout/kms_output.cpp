// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/kms_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "display/kms/device/drm_handles.h"
#include "display/kms/device/television_modes.h"

namespace lenticule::display {
namespace {

constexpr int kModesetAttempts = 20;
constexpr Nanoseconds kModesetPause = std::chrono::milliseconds(50);
constexpr uint32_t kTestOnly = DRM_MODE_ATOMIC_TEST_ONLY;
constexpr uint32_t kAllowModeset = DRM_MODE_ATOMIC_ALLOW_MODESET;
constexpr uint32_t kFlipFlags = DRM_MODE_ATOMIC_NONBLOCK | DRM_MODE_PAGE_FLIP_EVENT;

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

void append(std::vector<PropertySetting>& to, const std::vector<PropertySetting>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

/// Unlinks the objects other than `except` whose CRTC_ID is `crtc`.
void unlink(std::vector<PropertySetting>& settings, const PropertyTable& table, uint32_t crtc,
            bool is_plane) {
  if (table.value("CRTC_ID") != crtc) return;
  settings.push_back({table.object(), table.require("CRTC_ID"), 0});
  if (is_plane) settings.push_back({table.object(), table.require("FB_ID"), 0});
}

const char* hint_for(int error) {
  switch (error) {
    case EACCES:
    case EPERM:
      return "another program draws on this card: stop the desktop session or plymouth";
    case ENOSPC:
      return "the link or the card lacks the bandwidth: use a better cable or port, or a lower "
             "refresh rate; the size is never reduced";
    case ERANGE:
      return "the driver would have to scale";
    default:
      return "'lenticule doctor' tests this output";
  }
}

}  // namespace

KmsOutput::KmsOutput(DrmDevice device, Pipe pipe, std::shared_ptr<KmsPlatform> platform)
    : device_(std::move(device)),
      pipe_(std::move(pipe)),
      tables_(read_tables(device_.fd(), pipe_)),
      audit_(tables_),
      gamma_(device_.fd(), tables_.crtc),
      mode_blob_(make_mode_blob(device_.fd(), pipe_.mode)),
      framebuffer_property_(tables_.plane.require("FB_ID")),
      platform_(std::move(platform)),
      link_(link_info()),
      place_{.card = device_.path(), .connector = pipe_.connector.name, .crtc = pipe_.crtc} {}

std::vector<PropertySetting> KmsOutput::plane_settings(uint32_t framebuffer) const {
  const PropertyTable& plane = tables_.plane;
  const uint64_t width = pipe_.mode.hdisplay;
  const uint64_t height = pipe_.mode.vdisplay;
  const auto set = [&](const char* name, uint64_t value) {
    return PropertySetting{plane.object(), plane.require(name), value};
  };
  return {set("FB_ID", framebuffer), set("CRTC_ID", pipe_.crtc), set("SRC_X", 0),  set("SRC_Y", 0),
          set("SRC_W", width << 16), set("SRC_H", height << 16), set("CRTC_X", 0), set("CRTC_Y", 0),
          set("CRTC_W", width),      set("CRTC_H", height)};
}

std::vector<PropertySetting> KmsOutput::mode_settings() const {
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

/// Returns the settings that detach other objects from this CRTC: a cursor, an overlay, a cloned
/// panel.
std::vector<PropertySetting> KmsOutput::unlink_settings() const {
  std::vector<PropertySetting> settings;
  const int fd = device_.fd();
  const DrmPlanes planes(drmModeGetPlaneResources(fd));
  for (uint32_t i = 0; planes && i < planes->count_planes; ++i) {
    if (planes->planes[i] == pipe_.plane) continue;
    if (const auto table = PropertyTable::read(fd, planes->planes[i], DRM_MODE_OBJECT_PLANE))
      unlink(settings, *table, pipe_.crtc, true);
  }
  const DrmResources resources(drmModeGetResources(fd));
  for (int i = 0; resources && i < resources->count_connectors; ++i) {
    if (resources->connectors[i] == pipe_.connector.id) continue;
    if (const auto table =
            PropertyTable::read(fd, resources->connectors[i], DRM_MODE_OBJECT_CONNECTOR))
      unlink(settings, *table, pipe_.crtc, false);
  }
  return settings;
}

std::vector<PropertySetting> KmsOutput::everything(uint32_t framebuffer) const {
  std::vector<PropertySetting> settings = mode_settings();
  append(settings, plane_settings(framebuffer));
  append(settings, unlink_settings());
  append(settings, audit_.settings());
  return settings;
}

int KmsOutput::commit(const std::vector<PropertySetting>& settings, uint32_t flags) const {
  AtomicRequest request;
  request.set(settings);
  return request.commit(device_.fd(), flags);
}

bool KmsOutput::runs_in_mode() const {
  if (tables_.connector.value("CRTC_ID") != pipe_.crtc) return false;
  if (tables_.crtc.value("ACTIVE") != 1 || pipe_.connector.link_bad) return false;
  const DrmCrtc crtc(drmModeGetCrtc(device_.fd(), pipe_.crtc));
  return crtc && crtc->mode_valid != 0 && same_timings(crtc->mode, pipe_.mode);
}

void KmsOutput::remember(uint32_t framebuffer) {
  std::vector<PropertySetting> changes = mode_settings();
  append(changes, plane_settings(framebuffer));
  append(changes, audit_.settings());
  saved_.remember(device_.fd(), changes, {&tables_.connector, &tables_.crtc, &tables_.plane});
}

bool KmsOutput::take_over(uint32_t framebuffer) {
  if (!runs_in_mode()) return false;
  std::vector<PropertySetting> settings = plane_settings(framebuffer);
  append(settings, unlink_settings());
  append(settings, audit_.settings());
  if (commit(settings, kTestOnly) != 0) return false;
  remember(framebuffer);
  took_over_ = commit(settings, 0) == 0;
  if (took_over_) settle();
  return took_over_;
}

void KmsOutput::activate(uint32_t framebuffer, Clock& clock, RunningMode running) {
  if (running == RunningMode::TakeOver && take_over(framebuffer)) return;
  remember(framebuffer);
  int error = test(framebuffer);
  if (error != 0) fail(-error);

  error = commit(everything(framebuffer), kAllowModeset);
  for (int i = 1; error == -EBUSY && i < kModesetAttempts; ++i) {
    (void)clock.wait_until(clock.now() + kModesetPause, -1);
    error = commit(everything(framebuffer), kAllowModeset);
  }
  if (error != 0) fail(-error);
  settle();
}

int KmsOutput::rehearse(uint32_t framebuffer) {
  const int error = test(framebuffer);
  update_report(std::nullopt);
  return error;
}

int KmsOutput::test(uint32_t framebuffer) {
  const int error = commit(everything(framebuffer), kTestOnly | kAllowModeset);
  if (error != -EINVAL) return error;
  find_refused_settings(framebuffer);
  return commit(everything(framebuffer), kTestOnly | kAllowModeset);
}

/// Finds the settings that the driver refuses. A driver refuses a request as a whole, so each
/// setting is tested on top of the accepted ones.
void KmsOutput::find_refused_settings(uint32_t framebuffer) {
  for (size_t i = 0; i < audit_.count(); ++i) audit_.set_refused(i, true);
  for (size_t i = 0; i < audit_.count(); ++i) {
    audit_.set_refused(i, false);
    if (commit(everything(framebuffer), kTestOnly | kAllowModeset) != 0)
      audit_.set_refused(i, true);
  }
}

void KmsOutput::fail(int error) const {
  throw Error(ErrorKind::Device,
              fmt::format("{} on {}: cannot show {}: {}", pipe_.connector.name, device_.path(),
                          to_string(pipe_.mode), std::strerror(error)),
              hint_for(error));
}

int KmsOutput::flip(uint32_t framebuffer, uint64_t id) noexcept {
  flip_request_.clear();
  flip_request_.set({pipe_.plane, framebuffer_property_, framebuffer});
  return flip_request_.commit(device_.fd(), kFlipFlags, id);
}

int KmsOutput::show(uint32_t framebuffer) noexcept {
  flip_request_.clear();
  flip_request_.set({pipe_.plane, framebuffer_property_, framebuffer});
  return flip_request_.commit(device_.fd(), 0);
}

int KmsOutput::set_mode(uint32_t framebuffer) noexcept {
  try {
    const int error = commit(everything(framebuffer), kAllowModeset);
    if (error == 0) settle();
    return error;
  } catch (...) {
    return -ENOMEM;
  }
}

int KmsOutput::blank() noexcept {
  try {
    return commit({{tables_.crtc.object(), tables_.crtc.require("ACTIVE"), 0}}, kAllowModeset);
  } catch (...) {
    return -ENOMEM;
  }
}

bool KmsOutput::restore() noexcept {
  const bool ramp_is_back = gamma_.restore() == 0;
  return (saved_.empty() || saved_.restore(device_.fd())) && ramp_is_back;
}

int KmsOutput::read_sequence(uint64_t& sequence, Nanoseconds& time) const noexcept {
  uint64_t nanoseconds = 0;
  if (drmCrtcGetSequence(device_.fd(), pipe_.crtc, &sequence, &nanoseconds) != 0) return -errno;
  time = Nanoseconds(static_cast<int64_t>(nanoseconds));
  return 0;
}

int KmsOutput::queue_sequence(uint64_t sequence, uint64_t id) const noexcept {
  uint64_t queued = 0;
  const int result = drmCrtcQueueSequence(device_.fd(), pipe_.crtc, DRM_CRTC_SEQUENCE_NEXT_ON_MISS,
                                          sequence, &queued, id);
  return result == 0 ? 0 : -errno;
}

bool KmsOutput::placed_one_to_one(const PipeTables& tables) const {
  const uint64_t width = pipe_.mode.hdisplay;
  const uint64_t height = pipe_.mode.vdisplay;
  const PropertyTable& plane = tables.plane;
  return plane.value("SRC_X") == 0 && plane.value("SRC_Y") == 0 && plane.value("CRTC_X") == 0 &&
         plane.value("CRTC_Y") == 0 && plane.value("SRC_W") == width << 16 &&
         plane.value("SRC_H") == height << 16 && plane.value("CRTC_W") == width &&
         plane.value("CRTC_H") == height;
}

/// Completes an accepted commit: sets the legacy gamma ramp and updates the report.
void KmsOutput::settle() {
  (void)gamma_.make_linear();  // the report states whether it is linear
  update_report(PipeTables::read(device_.fd(), pipe_.connector.id, pipe_.crtc, pipe_.plane));
}

LinkInfo KmsOutput::link_info() const {
  const EdidReading& edid = pipe_.connector.edid;
  const PixelSize size{pipe_.mode.hdisplay, pipe_.mode.vdisplay};
  const std::vector<PixelSize> native = edid.native_sizes();
  return {.connector_type = pipe_.connector.type,
          .driver = device_.driver(),
          .edid_known = edid.identity.has_value(),
          .offers_ycbcr = edid.offers_ycbcr,
          .only_as_420 = is_one_of(pipe_.mode, edid.only_as_420),
          .bits_per_colour = edid.bits_per_colour,
          .other_native_size =
              !native.empty() && std::find(native.begin(), native.end(), size) == native.end(),
          .one_to_one = std::nullopt};
}

void KmsOutput::update_connector(ConnectorInfo connector) {
  pipe_.connector = std::move(connector);
  LinkInfo info = link_info();
  const std::lock_guard lock(mutex_);
  link_ = std::move(info);
}

ExactnessReport KmsOutput::make_report(const std::optional<PipeTables>& now, AuditDepth depth) {
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

void KmsOutput::update_report(const std::optional<PipeTables>& now) {
  ExactnessReport report = make_report(now, AuditDepth::Everything);
  const std::lock_guard lock(mutex_);
  report_ = std::move(report);
  ++reports_by_owner_;
}

bool KmsOutput::audit_again(AuditDepth depth) {
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

ExactnessReport KmsOutput::report() const {
  const std::lock_guard lock(mutex_);
  return report_;
}

}  // namespace lenticule::display
