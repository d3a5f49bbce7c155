// SPDX-License-Identifier: Apache-2.0
// KmsOutput controls the pipes that show one framebuffer at a time, pixel for pixel: one pipe, or
// one for each tile of a panel with several connectors, or for each panel of a wall. All pipes
// change in one commit, if the driver can do that. KmsOutput makes the kernel calls; KmsDisplay
// decides when.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "display/clock.h"
#include "display/kms/color/exactness_audit.h"
#include "display/kms/color/legacy_gamma.h"
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

  [[nodiscard]] KmsStatistics snapshot() const noexcept;
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
  OutputPipe(const DrmDevice& device, Pipe pipe, std::shared_ptr<KmsPlatform> platform);

  [[nodiscard]] const Pipe& pipe() const { return pipe_; }
  [[nodiscard]] ExactnessAudit& audit() { return audit_; }
  [[nodiscard]] const ExactnessAudit& audit() const { return audit_; }

  [[nodiscard]] std::vector<PropertySetting> plane_settings(uint32_t framebuffer) const;
  [[nodiscard]] std::vector<PropertySetting> mode_settings() const;
  /// Returns the settings that detach other objects from this CRTC, except these planes and
  /// connectors: a cursor, an overlay, a cloned panel.
  [[nodiscard]] std::vector<PropertySetting> unlink_settings(
      const std::vector<uint32_t>& except) const;
  [[nodiscard]] PropertySetting framebuffer_setting(uint32_t framebuffer) const noexcept {
    return {pipe_.plane, framebuffer_property_, framebuffer};
  }
  [[nodiscard]] PropertySetting off_setting() const {
    return {tables_.crtc.object(), tables_.crtc.require("ACTIVE"), 0};
  }

  /// Returns true if the panel ran in the pipe's mode when the object was made.
  [[nodiscard]] bool runs_in_mode() const;
  /// Stores the values that the settings will change.
  void remember(uint32_t framebuffer);
  /// Restores the values that remember() stored.
  bool restore() noexcept;
  /// Completes an accepted commit: sets the legacy gamma ramp and updates the report.
  void settle();

  /// Makes a report of the facts known before a test or a commit.
  void foresee() { update_report(std::nullopt); }
  /// Updates the connector's data, which reports use.
  void update_connector(ConnectorInfo connector);
  /// Thread safety: any thread.
  [[nodiscard]] ExactnessReport report() const;
  /// See KmsOutput::audit_again().
  [[nodiscard]] bool audit_again(AuditDepth depth);

 private:
  [[nodiscard]] ExactnessReport make_report(const std::optional<PipeTables>& now, AuditDepth depth);
  void update_report(const std::optional<PipeTables>& now);

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
  KmsOutput(DrmDevice device, std::vector<Pipe> pipes, std::shared_ptr<KmsPlatform> platform);

  /// Shows the first frame: without a modeset if the panel already runs in this mode and may be
  /// taken over, else with a modeset that was tested before. Sets every property of the audit that
  /// the driver accepts. Throws Error(Device).
  void activate(uint32_t framebuffer, Clock& clock, RunningMode running);
  /// Takes over a displayed picture without a modeset. Returns false if the kernel would need one.
  [[nodiscard]] bool take_over(uint32_t framebuffer);

  /// Makes a report of the facts known before a test or a commit.
  void foresee() {
    for (const auto& pipe : pipes_) pipe->foresee();
  }
  /// Tests with the driver what activate() would do, without doing it: returns 0 or a negative
  /// errno. The report then states which properties would be forced or refused.
  [[nodiscard]] int rehearse(uint32_t framebuffer);

  /// Flips at the next vblank. Each CRTC sends an event that contains `id`. If the driver refuses
  /// one commit for all pipes, each gets its own from then on, until the next modeset. If such a
  /// commit fails, those before it remain; flip() can be called again for the same framebuffer.
  [[nodiscard]] int flip(uint32_t framebuffer, uint64_t id) noexcept;
  /// Returns true if one commit flips all pipes. Thread safety: any thread.
  [[nodiscard]] bool flips_jointly() const noexcept {
    return joint_.load(std::memory_order_relaxed);
  }
  /// Shows the framebuffer with a blocking commit, without a modeset.
  [[nodiscard]] int show(uint32_t framebuffer) noexcept {
    return commit_framebuffer(pipes_, framebuffer, 0, 0);
  }
  /// Shows the framebuffer with a blocking modeset.
  [[nodiscard]] int set_mode(uint32_t framebuffer) noexcept;
  /// Updates the data of the n-th pipe's connector, which reports use.
  void update_connector(size_t n, ConnectorInfo connector) {
    pipes_[n]->update_connector(std::move(connector));
  }
  /// Switches the CRTCs off.
  [[nodiscard]] int blank() noexcept;
  /// Restores the state that activate() found.
  bool restore() noexcept;

  [[nodiscard]] const DrmDevice& device() const { return device_; }
  /// Returns the n-th pipe. The first one's panel identifies the output, its CRTC counts vblanks.
  [[nodiscard]] const Pipe& pipe(size_t n = 0) const { return pipes_[n]->pipe(); }
  [[nodiscard]] size_t pipe_count() const noexcept { return pipes_.size(); }
  /// Returns the number of the pipe with this CRTC.
  [[nodiscard]] std::optional<size_t> pipe_of_crtc(uint32_t crtc) const noexcept;
  /// Returns the ids of all connectors, the first pipe's first.
  [[nodiscard]] std::vector<uint32_t> connectors() const;
  /// Returns the names of all connectors: "DP-1 and DP-2".
  [[nodiscard]] std::string name() const;
  /// Reads the driver's vblank count and its time, if the driver counts.
  [[nodiscard]] int read_sequence(uint64_t& sequence, Nanoseconds& time) const noexcept;
  [[nodiscard]] int queue_sequence(uint64_t sequence, uint64_t id) const noexcept;
  /// Returns true if activate() needed no modeset.
  [[nodiscard]] bool took_over() const { return took_over_; }
  /// Thread safety: any thread.
  [[nodiscard]] ExactnessReport report() const;
  /// Reads all properties again and updates the report; changes nothing on the output. Returns true
  /// if a property that was neutral no longer is, so that set_mode() would help. Thread safety: any
  /// thread, once activate() or take_over() has returned; flips do not wait for it.
  [[nodiscard]] bool audit_again(AuditDepth depth);

 private:
  [[nodiscard]] std::vector<PropertySetting> unlink_settings() const;
  [[nodiscard]] std::vector<PropertySetting> everything(uint32_t framebuffer) const;
  [[nodiscard]] int commit(const std::vector<PropertySetting>& settings, uint32_t flags) const;
  [[nodiscard]] int commit_framebuffer(std::span<const std::unique_ptr<OutputPipe>> pipes,
                                       uint32_t framebuffer, uint32_t flags, uint64_t id) noexcept;
  [[nodiscard]] int flip_one_by_one(uint32_t framebuffer, uint64_t id) noexcept;
  [[nodiscard]] int test(uint32_t framebuffer);
  void find_refused_settings(uint32_t framebuffer);
  [[noreturn]] void fail(int error) const;
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
