// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/kms_output.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace lenticule::display {

KmsStatistics KmsCounters::snapshot() const noexcept {
  return {.flips = flips,
          .busy = busy,
          .denied = denied,
          .refused = refused,
          .flip_timeouts = flip_timeouts,
          .stray_events = stray_events,
          .truncated_reads = truncated_reads,
          .recoveries = recoveries,
          .modesets = modesets,
          .hotplugs = hotplugs,
          .links_bad = links_bad,
          .suspends = suspends,
          .times_paused = times_paused,
          .lost_ticks = lost_ticks,
          .largest_skew = largest_skew,
          .panel = panel,
          .hardware_clock = hardware_clock,
          .off = off};
}

const char* panel_state_name(PanelState state) {
  switch (state) {
    case PanelState::Showing:
      return "showing";
    case PanelState::Disconnected:
      return "disconnected";
    case PanelState::Unreadable:
      return "unreadable";
    case PanelState::ModeMissing:
      return "mode missing";
    case PanelState::WrongPanel:
      return "wrong panel";
  }
  return "?";
}

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
      platform_(std::move(platform)) {}

std::vector<PropertySetting> OutputPipe::plane_settings(uint32_t framebuffer) const {
  const PropertyTable& plane = tables_.plane;
  const uint64_t width = pipe_.mode.hdisplay;
  const uint64_t height = pipe_.mode.vdisplay;
  const auto set = [&](const char* name, uint64_t value) {
    return PropertySetting{plane.object(), plane.require(name), value};
  };
  return {set("FB_ID", framebuffer),
          set("CRTC_ID", pipe_.crtc),
          set("SRC_X", pipe_.source_x()),
          set("SRC_Y", pipe_.source_y()),
          set("SRC_W", width << 16),
          set("SRC_H", height << 16),
          set("CRTC_X", 0),
          set("CRTC_Y", 0),
          set("CRTC_W", width),
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

/// Completes an accepted commit: sets the legacy gamma ramp and updates the report.
void OutputPipe::settle() {
  (void)gamma_.make_linear();  // the report states whether it is linear
  update_report(PipeTables::read(device_.fd(), pipe_.connector.id, pipe_.crtc, pipe_.plane));
}

void OutputPipe::update_connector(ConnectorInfo connector) {
  const std::lock_guard lock(mutex_);
  pipe_.connector = std::move(connector);
}

ExactnessReport OutputPipe::make_report(const std::optional<PipeTables>& now, AuditDepth depth) {
  std::unique_lock reading(mutex_);
  const Pipe pipe = pipe_;
  std::vector<AuditRow> debugfs_rows = debugfs_rows_;
  reading.unlock();
  std::vector<AuditRow> further = read_sysfs_rows(*platform_, device_.path(), pipe);
  if (depth == AuditDepth::Everything) {
    debugfs_rows = read_debugfs_rows(*platform_, device_.path(), pipe);
    const std::lock_guard lock(mutex_);
    debugfs_rows_ = debugfs_rows;
  }
  further.insert(further.end(), debugfs_rows.begin(), debugfs_rows.end());
  if (const auto ramp = gamma_.row(now.has_value())) further.push_back(*ramp);
  return audit_.report(pipe, device_.driver(), now, further);
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

namespace {

constexpr int kModesetAttempts = 20;
constexpr Nanoseconds kModesetPause = std::chrono::milliseconds(50);
constexpr uint32_t kTestOnly = DRM_MODE_ATOMIC_TEST_ONLY;
constexpr uint32_t kAllowModeset = DRM_MODE_ATOMIC_ALLOW_MODESET;
constexpr uint32_t kFlipFlags = DRM_MODE_ATOMIC_NONBLOCK | DRM_MODE_PAGE_FLIP_EVENT;

/// Adds the facts that are not in the report yet.
void add_report(ExactnessReport& to, const ExactnessReport& from) {
  const auto add = [](std::vector<std::string>& list, const std::vector<std::string>& more) {
    for (const std::string& text : more)
      if (std::ranges::find(list, text) == list.end()) list.push_back(text);
  };
  add(to.verified, from.verified);
  add(to.reasons, from.reasons);
  add(to.unseen, from.unseen);
  add(to.remarks, from.remarks);
  add(to.remedies, from.remedies);
  to.rows.insert(to.rows.end(), from.rows.begin(), from.rows.end());
  to.conclude();
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

KmsOutput::KmsOutput(DrmDevice device, std::vector<Pipe> pipes,
                     std::shared_ptr<KmsPlatform> platform)
    : device_(std::move(device)) {
  LENTICULE_CHECK(!pipes.empty());
  for (Pipe& pipe : pipes)
    pipes_.push_back(std::make_unique<OutputPipe>(device_, std::move(pipe), platform));
}

std::optional<size_t> KmsOutput::pipe_of_crtc(uint32_t crtc) const noexcept {
  for (size_t n = 0; n < pipes_.size(); ++n)
    if (pipes_[n]->pipe().crtc == crtc) return n;
  return std::nullopt;
}

std::vector<uint32_t> KmsOutput::connectors() const {
  std::vector<uint32_t> ids;
  for (const auto& pipe : pipes_) ids.push_back(pipe->pipe().connector.id);
  return ids;
}

std::string KmsOutput::name() const {
  std::vector<std::string> names;
  for (const auto& pipe : pipes_) names.push_back(pipe->pipe().connector.name);
  return fmt::format("{}", fmt::join(names, " and "));
}

std::vector<PropertySetting> KmsOutput::unlink_settings() const {
  std::vector<uint32_t> own;
  for (const auto& pipe : pipes_) {
    own.push_back(pipe->pipe().plane);
    own.push_back(pipe->pipe().connector.id);
  }
  std::vector<PropertySetting> settings;
  for (const auto& pipe : pipes_) append(settings, pipe->unlink_settings(own));
  return settings;
}

std::vector<PropertySetting> KmsOutput::everything(uint32_t framebuffer) const {
  std::vector<PropertySetting> settings = unlink_settings();
  for (const auto& pipe : pipes_) {
    append(settings, pipe->mode_settings());
    append(settings, pipe->plane_settings(framebuffer));
    append(settings, pipe->audit().settings());
  }
  return settings;
}

int KmsOutput::commit(const std::vector<PropertySetting>& settings, uint32_t flags) const {
  AtomicRequest request;
  request.set(settings);
  return request.commit(device_.fd(), flags);
}

bool KmsOutput::take_over(uint32_t framebuffer) {
  std::vector<PropertySetting> settings = unlink_settings();
  for (const auto& pipe : pipes_) {
    if (!pipe->runs_in_mode()) return false;
    append(settings, pipe->plane_settings(framebuffer));
    append(settings, pipe->audit().settings());
  }
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
  foresee();
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
  for (const auto& pipe : pipes_)
    for (size_t i = 0; i < pipe->audit().count(); ++i) pipe->audit().set_refused(i, true);
  for (const auto& pipe : pipes_)
    for (size_t i = 0; i < pipe->audit().count(); ++i) {
      pipe->audit().set_refused(i, false);
      if (commit(everything(framebuffer), kTestOnly | kAllowModeset) != 0)
        pipe->audit().set_refused(i, true);
    }
}

void KmsOutput::fail(int error) const {
  throw Error(ErrorKind::Device,
              fmt::format("{} on {}: cannot show {}: {}", name(), device_.path(),
                          to_string(pipe().mode), std::strerror(error)),
              hint_for(error));
}

int KmsOutput::commit_framebuffer(std::span<const std::unique_ptr<OutputPipe>> pipes,
                                  uint32_t framebuffer, uint32_t flags, uint64_t id) noexcept {
  flip_request_.clear();
  for (const auto& pipe : pipes) flip_request_.set(pipe->framebuffer_setting(framebuffer));
  return flip_request_.commit(device_.fd(), flags, id);
}

int KmsOutput::flip(uint32_t framebuffer, uint64_t id) noexcept {
  if (!flips_jointly()) return flip_one_by_one(framebuffer, id);
  const int error = commit_framebuffer(pipes_, framebuffer, kFlipFlags, id);
  if (error != -EINVAL || pipes_.size() == 1) return error;
  if (flip_one_by_one(framebuffer, id) != 0) return error;
  joint_.store(false, std::memory_order_relaxed);
  return 0;
}

int KmsOutput::flip_one_by_one(uint32_t framebuffer, uint64_t id) noexcept {
  for (const auto& pipe : pipes_)
    if (const int error = commit_framebuffer({&pipe, 1}, framebuffer, kFlipFlags, id); error != 0)
      return error;
  return 0;
}

int KmsOutput::set_mode(uint32_t framebuffer) noexcept {
  try {
    const int error = commit(everything(framebuffer), kAllowModeset);
    if (error == 0) {
      settle();
      joint_.store(true, std::memory_order_relaxed);
    }
    return error;
  } catch (...) {
    return -ENOMEM;
  }
}

int KmsOutput::blank() noexcept {
  try {
    std::vector<PropertySetting> off;
    for (const auto& pipe : pipes_) off.push_back(pipe->off_setting());
    return commit(off, kAllowModeset);
  } catch (...) {
    return -ENOMEM;
  }
}

bool KmsOutput::restore() noexcept {
  bool restored = true;
  for (const auto& pipe : pipes_) restored = pipe->restore() && restored;
  return restored;
}

int KmsOutput::read_sequence(uint64_t& sequence, Nanoseconds& time) const noexcept {
  uint64_t nanoseconds = 0;
  if (drmCrtcGetSequence(device_.fd(), pipe().crtc, &sequence, &nanoseconds) != 0) return -errno;
  time = Nanoseconds(static_cast<int64_t>(nanoseconds));
  return 0;
}

int KmsOutput::queue_sequence(uint64_t sequence, uint64_t id) const noexcept {
  uint64_t queued = 0;
  const int result = drmCrtcQueueSequence(device_.fd(), pipe().crtc, DRM_CRTC_SEQUENCE_NEXT_ON_MISS,
                                          sequence, &queued, id);
  return result == 0 ? 0 : -errno;
}

bool KmsOutput::audit_again(AuditDepth depth) {
  bool lost = false;
  for (const auto& pipe : pipes_) lost = pipe->audit_again(depth) || lost;
  return lost;
}

ExactnessReport KmsOutput::report() const {
  ExactnessReport report = pipes_.front()->report();
  for (size_t n = 1; n < pipes_.size(); ++n) add_report(report, pipes_[n]->report());
  return report;
}

}  // namespace lenticule::display
