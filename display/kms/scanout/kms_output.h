// SPDX-License-Identifier: Apache-2.0
// KmsOutput controls the pipes that show one framebuffer at a time, pixel for pixel: one pipe, or
// one for each tile of a panel with several connectors, or for each panel of a wall. All pipes
// change in one commit, if the driver can do that. KmsOutput makes the kernel calls; KmsDisplay
// decides when.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "display/clock.h"
#include "display/kms/color/exactness_audit.h"
#include "display/kms/device/connector.h"
#include "display/kms/device/drm_device.h"
#include "display/kms/device/drm_properties.h"
#include "display/kms/device/platform.h"
#include "display/kms/probe/output_choice.h"
#include "display/kms/scanout/kms_display.h"

namespace lenticule::display {

/// KmsCounters holds the counters of a running KMS display. docs/play/kms.md explains each figure.
/// Thread safety: written by the presenter thread, read by any.
struct KmsCounters {
  std::atomic<uint64_t> flips, busy, denied, refused, flip_timeouts, stray_events, truncated_reads,
      recoveries, modesets, hotplugs, links_bad, suspends, times_paused, lost_ticks;
  std::atomic<Nanoseconds> largest_skew;
  std::atomic<PanelState> panel;
  std::atomic<bool> hardware_clock, off;

  [[nodiscard]] KmsStatistics snapshot() const noexcept {
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
};

/// Extent of a repeated audit.
enum class AuditDepth {
  Properties,  ///< and sysfs: does not disturb flips
  Everything,  ///< also the driver's debugfs files, for which the driver takes locks
};

/// OutputPipe holds the properties of one pipe of an output, their audit, and the settings with
/// which the pipe shows its part of a framebuffer pixel for pixel. KmsOutput commits the settings.
/// Thread safety: one thread, except for report() and audit_again().
class OutputPipe {
 public:
  /// Throws Error(Device) if the driver lacks a feature that atomic modesetting needs. Lifetime:
  /// the device must outlive the object.
  OutputPipe(const DrmDevice& device, Pipe pipe, std::shared_ptr<KmsPlatform> platform)
      : device_(device),
        pipe_(std::move(pipe)),
        tables_(read_tables(device_.fd(), pipe_)),
        audit_(tables_, pipe_.depth),
        gamma_(device_.fd(), tables_.crtc),
        mode_blob_(make_mode_blob(device_.fd(), pipe_.mode)),
        framebuffer_property_(tables_.plane.require("FB_ID")),
        platform_(std::move(platform)) {}

  [[nodiscard]] const Pipe& pipe() const { return pipe_; }
  [[nodiscard]] ExactnessAudit& audit() { return audit_; }
  [[nodiscard]] const ExactnessAudit& audit() const { return audit_; }

  [[nodiscard]] std::vector<PropertySetting> plane_settings(uint32_t framebuffer) const {
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
  [[nodiscard]] std::vector<PropertySetting> mode_settings() const {
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
  /// Returns the settings that detach other objects from this CRTC, except these planes and
  /// connectors: a cursor, an overlay, a cloned panel.
  [[nodiscard]] std::vector<PropertySetting> unlink_settings(
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
  [[nodiscard]] PropertySetting framebuffer_setting(uint32_t framebuffer) const noexcept {
    return {pipe_.plane, framebuffer_property_, framebuffer};
  }
  [[nodiscard]] PropertySetting off_setting() const {
    return {tables_.crtc.object(), tables_.crtc.require("ACTIVE"), 0};
  }

  /// Returns true if the panel ran in the pipe's mode when the object was made.
  [[nodiscard]] bool runs_in_mode() const {
    if (tables_.connector.value("CRTC_ID") != pipe_.crtc) return false;
    if (tables_.crtc.value("ACTIVE") != 1 || pipe_.connector.link_bad) return false;
    const DrmCrtc crtc(drmModeGetCrtc(device_.fd(), pipe_.crtc));
    return crtc && crtc->mode_valid != 0 && same_timings(crtc->mode, pipe_.mode);
  }
  /// Stores the values that the settings will change.
  void remember(uint32_t framebuffer) {
    std::vector<PropertySetting> changes = mode_settings();
    append(changes, plane_settings(framebuffer));
    append(changes, audit_.settings());
    saved_.remember(device_.fd(), changes, {&tables_.connector, &tables_.crtc, &tables_.plane});
  }
  /// Restores the values that remember() stored.
  bool restore() noexcept {
    const bool ramp_is_back = gamma_.restore() == 0;
    return (saved_.empty() || saved_.restore(device_.fd())) && ramp_is_back;
  }
  /// Completes an accepted commit: sets the legacy gamma ramp and updates the report.
  void settle() {
    (void)gamma_.make_linear();  // the report states whether it is linear
    update_report(PipeTables::read(device_.fd(), pipe_.connector.id, pipe_.crtc, pipe_.plane));
  }

  /// Makes a report of the facts known before a test or a commit.
  void foresee() { update_report(std::nullopt); }
  /// Updates the connector's data, which reports use.
  void update_connector(ConnectorInfo connector) {
    const std::lock_guard lock(mutex_);
    pipe_.connector = std::move(connector);
  }
  /// Thread safety: any thread.
  [[nodiscard]] ExactnessReport report() const {
    const std::lock_guard lock(mutex_);
    return report_;
  }
  /// See KmsOutput::audit_again().
  [[nodiscard]] bool audit_again(AuditDepth depth) {
    uint64_t before = 0;
    {
      const std::lock_guard lock(mutex_);
      before = reports_by_owner_;
    }
    const auto now = PipeTables::read(device_.fd(), tables_.connector.object(),
                                      tables_.crtc.object(), tables_.plane.object());
    if (!now) return false;  // the connector is gone; the panel's state reports that
    ExactnessReport report = make_report(now, depth);
    const std::lock_guard lock(mutex_);
    if (reports_by_owner_ != before) return false;
    const bool lost = lost_a_setting(report_, report);
    report_ = std::move(report);
    return lost;
  }

 private:
  static PipeTables read_tables(int fd, const Pipe& pipe) {
    auto tables = PipeTables::read(fd, pipe.connector.id, pipe.crtc, pipe.plane);
    if (tables) return std::move(*tables);
    throw device_error("{}: vanished", pipe.connector.name);
  }

  static BlobId make_mode_blob(int fd, const drmModeModeInfo& mode) {
    uint32_t id = 0;
    const int error = drmModeCreatePropertyBlob(fd, &mode, sizeof(mode), &id);
    if (error != 0) throw device_error("kms: cannot create a mode: {}", std::strerror(-error));
    return {fd, id};
  }

  /// Unlinks the objects other than `except` whose CRTC_ID is `crtc`.
  static void unlink(std::vector<PropertySetting>& settings, const PropertyTable& table,
                     uint32_t crtc, bool is_plane) {
    if (table.value("CRTC_ID") != crtc) return;
    settings.push_back({table.object(), table.require("CRTC_ID"), 0});
    if (is_plane) settings.push_back({table.object(), table.require("FB_ID"), 0});
  }
  [[nodiscard]] ExactnessReport make_report(const std::optional<PipeTables>& now,
                                            AuditDepth depth) {
    std::unique_lock reading(mutex_);
    const Pipe pipe = pipe_;
    std::vector<AuditRow> debugfs_rows = debugfs_rows_;
    reading.unlock();
    std::vector<AuditRow> further = read_files(*platform_, device_.path(), pipe, kSysfs);
    if (depth == AuditDepth::Everything) {
      debugfs_rows = read_debugfs_rows(*platform_, device_.path(), pipe);
      const std::lock_guard lock(mutex_);
      debugfs_rows_ = debugfs_rows;
    }
    further.insert(further.end(), debugfs_rows.begin(), debugfs_rows.end());
    if (const auto ramp = gamma_.row(now.has_value())) further.push_back(*ramp);
    return audit_.report(pipe, device_.driver(), now, further);
  }
  void update_report(const std::optional<PipeTables>& now) {
    ExactnessReport report = make_report(now, AuditDepth::Everything);
    const std::lock_guard lock(mutex_);
    report_ = std::move(report);
    ++reports_by_owner_;
  }

  const DrmDevice& device_;
  Pipe pipe_;
  PipeTables tables_;  ///< values found at the start
  ExactnessAudit audit_;
  LegacyGamma gamma_;
  BlobId mode_blob_;
  SavedState saved_;
  uint32_t framebuffer_property_ = 0;
  std::shared_ptr<KmsPlatform> platform_;

  /// Guards the members below, and pipe_.connector, which only the owner's thread writes.
  mutable std::mutex mutex_;
  std::vector<AuditRow> debugfs_rows_;
  ExactnessReport report_;
  /// Counts the owner's reports; an audit that began before the newest one is discarded.
  uint64_t reports_by_owner_ = 0;
};

/// Handling of a mode in which the panel already runs.
enum class RunningMode { TakeOver, SetAnew };

/// Functions that return int return 0 or a negative errno, and do not throw. Thread safety: one
/// thread, except for report() and audit_again().
class KmsOutput {
 public:
  /// Throws Error(Device) if the driver lacks a feature that atomic modesetting needs.
  KmsOutput(DrmDevice device, std::vector<Pipe> pipes, std::shared_ptr<KmsPlatform> platform)
      : device_(std::move(device)) {
    LENTICULE_CHECK(!pipes.empty());
    for (Pipe& pipe : pipes)
      pipes_.push_back(std::make_unique<OutputPipe>(device_, std::move(pipe), platform));
  }

  /// Shows the first frame: without a modeset if the panel already runs in this mode and may be
  /// taken over, else with a modeset that was tested before. Sets every property of the audit that
  /// the driver accepts. Throws Error(Device).
  void activate(uint32_t framebuffer, Clock& clock, RunningMode running) {
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
  /// Takes over a displayed picture without a modeset. Returns false if the kernel would need one.
  [[nodiscard]] bool take_over(uint32_t framebuffer) {
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

  /// Makes a report of the facts known before a test or a commit.
  void foresee() {
    for (const auto& pipe : pipes_) pipe->foresee();
  }
  /// Tests with the driver what activate() would do, without doing it: returns 0 or a negative
  /// errno. The report then states which properties would be forced or refused.
  [[nodiscard]] int rehearse(uint32_t framebuffer) {
    const int error = test(framebuffer);
    foresee();
    return error;
  }

  /// Flips at the next vblank. Each CRTC sends an event that contains `id`. If the driver refuses
  /// one commit for all pipes, each gets its own from then on, until the next modeset. If such a
  /// commit fails, those before it remain; flip() can be called again for the same framebuffer.
  [[nodiscard]] int flip(uint32_t framebuffer, uint64_t id) noexcept {
    if (!flips_jointly()) return flip_one_by_one(framebuffer, id);
    const int error = commit_framebuffer(pipes_, framebuffer, kFlipFlags, id);
    if (error != -EINVAL || pipes_.size() == 1) return error;
    if (flip_one_by_one(framebuffer, id) != 0) return error;
    joint_.store(false, std::memory_order_relaxed);
    return 0;
  }
  /// Returns true if one commit flips all pipes. Thread safety: any thread.
  [[nodiscard]] bool flips_jointly() const noexcept {
    return joint_.load(std::memory_order_relaxed);
  }
  /// Shows the framebuffer with a blocking commit, without a modeset.
  [[nodiscard]] int show(uint32_t framebuffer) noexcept {
    return commit_framebuffer(pipes_, framebuffer, 0, 0);
  }
  /// Shows the framebuffer with a blocking modeset.
  [[nodiscard]] int set_mode(uint32_t framebuffer) noexcept {
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
  /// Updates the data of the n-th pipe's connector, which reports use.
  void update_connector(size_t n, ConnectorInfo connector) {
    pipes_[n]->update_connector(std::move(connector));
  }
  /// Switches the CRTCs off.
  [[nodiscard]] int blank() noexcept {
    try {
      std::vector<PropertySetting> off;
      for (const auto& pipe : pipes_) off.push_back(pipe->off_setting());
      return commit(off, kAllowModeset);
    } catch (...) {
      return -ENOMEM;
    }
  }
  /// Restores the state that activate() found.
  bool restore() noexcept {
    bool restored = true;
    for (const auto& pipe : pipes_) restored = pipe->restore() && restored;
    return restored;
  }

  [[nodiscard]] const DrmDevice& device() const { return device_; }
  /// Returns the n-th pipe. The first one's panel identifies the output, its CRTC counts vblanks.
  [[nodiscard]] const Pipe& pipe(size_t n = 0) const { return pipes_[n]->pipe(); }
  [[nodiscard]] size_t pipe_count() const noexcept { return pipes_.size(); }
  /// Returns the number of the pipe with this CRTC.
  [[nodiscard]] std::optional<size_t> pipe_of_crtc(uint32_t crtc) const noexcept {
    for (size_t n = 0; n < pipes_.size(); ++n)
      if (pipes_[n]->pipe().crtc == crtc) return n;
    return std::nullopt;
  }
  /// Returns the ids of all connectors, the first pipe's first.
  [[nodiscard]] std::vector<uint32_t> connectors() const {
    std::vector<uint32_t> ids;
    for (const auto& pipe : pipes_) ids.push_back(pipe->pipe().connector.id);
    return ids;
  }
  /// Returns the names of all connectors: "DP-1 and DP-2".
  [[nodiscard]] std::string name() const {
    std::vector<std::string> names;
    for (const auto& pipe : pipes_) names.push_back(pipe->pipe().connector.name);
    return fmt::format("{}", fmt::join(names, " and "));
  }
  /// Reads the driver's vblank count and its time, if the driver counts.
  [[nodiscard]] int read_sequence(uint64_t& sequence, Nanoseconds& time) const noexcept {
    uint64_t nanoseconds = 0;
    if (drmCrtcGetSequence(device_.fd(), pipe().crtc, &sequence, &nanoseconds) != 0) return -errno;
    time = Nanoseconds(static_cast<int64_t>(nanoseconds));
    return 0;
  }
  [[nodiscard]] int queue_sequence(uint64_t sequence, uint64_t id) const noexcept {
    uint64_t queued = 0;
    const int result = drmCrtcQueueSequence(device_.fd(), pipe().crtc,
                                            DRM_CRTC_SEQUENCE_NEXT_ON_MISS, sequence, &queued, id);
    return result == 0 ? 0 : -errno;
  }
  /// Returns true if activate() needed no modeset.
  [[nodiscard]] bool took_over() const { return took_over_; }
  /// Thread safety: any thread.
  [[nodiscard]] ExactnessReport report() const {
    ExactnessReport report = pipes_.front()->report();
    for (size_t n = 1; n < pipes_.size(); ++n) add_report(report, pipes_[n]->report());
    return report;
  }
  /// Reads all properties again and updates the report; changes nothing on the output. Returns true
  /// if a property that was neutral no longer is, so that set_mode() would help. Thread safety: any
  /// thread, once activate() or take_over() has returned; flips do not wait for it.
  [[nodiscard]] bool audit_again(AuditDepth depth) {
    bool lost = false;
    for (const auto& pipe : pipes_) lost = pipe->audit_again(depth) || lost;
    return lost;
  }

 private:
  static constexpr int kModesetAttempts = 20;
  static constexpr Nanoseconds kModesetPause = std::chrono::milliseconds(50);
  static constexpr uint32_t kTestOnly = DRM_MODE_ATOMIC_TEST_ONLY;
  static constexpr uint32_t kAllowModeset = DRM_MODE_ATOMIC_ALLOW_MODESET;
  static constexpr uint32_t kFlipFlags = DRM_MODE_ATOMIC_NONBLOCK | DRM_MODE_PAGE_FLIP_EVENT;

  /// Adds the facts that are not in the report yet.
  static void add_report(ExactnessReport& to, const ExactnessReport& from) {
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

  static const char* hint_for(int error) {
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
  [[nodiscard]] std::vector<PropertySetting> unlink_settings() const {
    std::vector<uint32_t> own;
    for (const auto& pipe : pipes_) {
      own.push_back(pipe->pipe().plane);
      own.push_back(pipe->pipe().connector.id);
    }
    std::vector<PropertySetting> settings;
    for (const auto& pipe : pipes_) append(settings, pipe->unlink_settings(own));
    return settings;
  }
  [[nodiscard]] std::vector<PropertySetting> everything(uint32_t framebuffer) const {
    std::vector<PropertySetting> settings = unlink_settings();
    for (const auto& pipe : pipes_) {
      append(settings, pipe->mode_settings());
      append(settings, pipe->plane_settings(framebuffer));
      append(settings, pipe->audit().settings());
    }
    return settings;
  }
  [[nodiscard]] int commit(const std::vector<PropertySetting>& settings, uint32_t flags) const {
    AtomicRequest request;
    request.set(settings);
    return request.commit(device_.fd(), flags);
  }
  [[nodiscard]] int commit_framebuffer(std::span<const std::unique_ptr<OutputPipe>> pipes,
                                       uint32_t framebuffer, uint32_t flags, uint64_t id) noexcept {
    flip_request_.clear();
    for (const auto& pipe : pipes) flip_request_.set(pipe->framebuffer_setting(framebuffer));
    return flip_request_.commit(device_.fd(), flags, id);
  }
  [[nodiscard]] int flip_one_by_one(uint32_t framebuffer, uint64_t id) noexcept {
    for (const auto& pipe : pipes_)
      if (const int error = commit_framebuffer({&pipe, 1}, framebuffer, kFlipFlags, id); error != 0)
        return error;
    return 0;
  }
  [[nodiscard]] int test(uint32_t framebuffer) {
    const int error = commit(everything(framebuffer), kTestOnly | kAllowModeset);
    if (error != -EINVAL) return error;
    find_refused_settings(framebuffer);
    return commit(everything(framebuffer), kTestOnly | kAllowModeset);
  }
  /// Finds the settings that the driver refuses. A driver refuses a request as a whole, so each
  /// setting is tested on top of the accepted ones.
  void find_refused_settings(uint32_t framebuffer) {
    for (const auto& pipe : pipes_)
      for (size_t i = 0; i < pipe->audit().count(); ++i) pipe->audit().set_refused(i, true);
    for (const auto& pipe : pipes_)
      for (size_t i = 0; i < pipe->audit().count(); ++i) {
        pipe->audit().set_refused(i, false);
        if (commit(everything(framebuffer), kTestOnly | kAllowModeset) != 0)
          pipe->audit().set_refused(i, true);
      }
  }
  [[noreturn]] void fail(int error) const {
    throw device_error("{} on {}: cannot show {}: {}", name(), device_.path(),
                       to_string(pipe().mode), std::strerror(error))
        .remedy(hint_for(error));
  }
  void remember(uint32_t framebuffer) {
    for (const auto& pipe : pipes_) pipe->remember(framebuffer);
  }
  void settle() {
    for (const auto& pipe : pipes_) pipe->settle();
  }

  DrmDevice device_;
  std::vector<std::unique_ptr<OutputPipe>> pipes_;  ///< the first is the reference
  AtomicRequest flip_request_;
  std::atomic<bool> joint_{true};
  bool took_over_ = false;
};

}  // namespace lenticule::display
