// SPDX-License-Identifier: Apache-2.0
// KmsOutput controls one connector, CRTC and primary plane that show one framebuffer at a time,
// pixel for pixel. It makes the kernel calls; KmsDisplay decides when.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "display/clock.h"
#include "display/kms/color/exactness_audit.h"
#include "display/kms/color/legacy_gamma.h"
#include "display/kms/color/link_readings.h"
#include "display/kms/device/atomic_request.h"
#include "display/kms/device/connector.h"
#include "display/kms/device/drm_device.h"
#include "display/kms/device/platform.h"
#include "display/kms/device/saved_state.h"
#include "display/kms/probe/pipe.h"

namespace lenticule::display {

/// Handling of a mode in which the panel already runs.
enum class RunningMode { TakeOver, SetAnew };

/// Extent of a repeated audit.
enum class AuditDepth {
  Properties,  ///< and sysfs: does not disturb flips
  Everything,  ///< also the driver's debugfs files, for which the driver takes locks
};

/// Functions that return int return 0 or a negative errno, and do not throw. Thread safety: one
/// thread, except for report() and audit_again().
class KmsOutput {
 public:
  /// Throws Error(Device) if the driver lacks a feature that atomic modesetting needs.
  KmsOutput(DrmDevice device, Pipe pipe, std::shared_ptr<KmsPlatform> platform);

  /// Shows the first frame: without a modeset if the panel already runs in this mode and may be
  /// taken over, else with a modeset that was tested before. Sets every property of the audit that
  /// the driver accepts. Throws Error(Device).
  void activate(uint32_t framebuffer, Clock& clock, RunningMode running);
  /// Takes over a displayed picture without a modeset. Returns false if the kernel would need one.
  [[nodiscard]] bool take_over(uint32_t framebuffer);

  /// Makes a report of the facts known before a test or a commit.
  void foresee() { update_report(std::nullopt); }
  /// Tests with the driver what activate() would do, without doing it: returns 0 or a negative
  /// errno. The report then states which properties would be forced or refused.
  [[nodiscard]] int rehearse(uint32_t framebuffer);

  /// Flips at the next vblank; the event contains `id`.
  [[nodiscard]] int flip(uint32_t framebuffer, uint64_t id) noexcept;
  /// Shows the framebuffer with a blocking commit, without a modeset.
  [[nodiscard]] int show(uint32_t framebuffer) noexcept;
  /// Shows the framebuffer with a blocking modeset.
  [[nodiscard]] int set_mode(uint32_t framebuffer) noexcept;
  /// Updates the connector's data, which reports use.
  void update_connector(ConnectorInfo connector);
  /// Switches the CRTC off.
  [[nodiscard]] int blank() noexcept;
  /// Restores the state that activate() found.
  bool restore() noexcept;

  [[nodiscard]] const DrmDevice& device() const { return device_; }
  [[nodiscard]] const Pipe& pipe() const { return pipe_; }
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
  [[nodiscard]] std::vector<PropertySetting> plane_settings(uint32_t framebuffer) const;
  [[nodiscard]] std::vector<PropertySetting> mode_settings() const;
  [[nodiscard]] std::vector<PropertySetting> unlink_settings() const;
  [[nodiscard]] std::vector<PropertySetting> everything(uint32_t framebuffer) const;
  [[nodiscard]] int commit(const std::vector<PropertySetting>& settings, uint32_t flags) const;
  [[nodiscard]] bool runs_in_mode() const;
  [[nodiscard]] bool placed_one_to_one(const PipeTables& tables) const;
  [[nodiscard]] int test(uint32_t framebuffer);
  void find_refused_settings(uint32_t framebuffer);
  [[noreturn]] void fail(int error) const;
  void remember(uint32_t framebuffer);
  void settle();
  [[nodiscard]] LinkInfo link_info() const;
  [[nodiscard]] ExactnessReport make_report(const std::optional<PipeTables>& now, AuditDepth depth);
  void update_report(const std::optional<PipeTables>& now);

  DrmDevice device_;
  Pipe pipe_;
  PipeTables tables_;  ///< values found at the start
  ExactnessAudit audit_;
  LegacyGamma gamma_;
  BlobId mode_blob_;
  SavedState saved_;
  AtomicRequest flip_request_;
  uint32_t framebuffer_property_ = 0;
  bool took_over_ = false;

  std::shared_ptr<KmsPlatform> platform_;

  mutable std::mutex mutex_;  ///< guards the members below
  LinkInfo link_;
  LinkPlace place_;
  std::vector<AuditRow> debugfs_rows_;
  ExactnessReport report_;
  /// Counts the owner's reports; an audit that began before the newest one is discarded.
  uint64_t reports_by_owner_ = 0;
};

}  // namespace lenticule::display
