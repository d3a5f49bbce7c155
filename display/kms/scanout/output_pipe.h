// SPDX-License-Identifier: Apache-2.0
// OutputPipe holds the properties of one pipe of an output, their audit, and the settings with
// which the pipe shows its part of a framebuffer pixel for pixel. KmsOutput commits the settings.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

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

/// Extent of a repeated audit.
enum class AuditDepth {
  Properties,  ///< and sysfs: does not disturb flips
  Everything,  ///< also the driver's debugfs files, for which the driver takes locks
};

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
  /// Returns SRC_X and SRC_Y, in 1/65536 pixel.
  [[nodiscard]] std::pair<uint64_t, uint64_t> source() const;
  [[nodiscard]] bool placed_one_to_one(const PipeTables& tables) const;
  [[nodiscard]] LinkInfo link_info() const;
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

  mutable std::mutex mutex_;  ///< guards the members below
  LinkInfo link_;
  LinkPlace place_;
  std::vector<AuditRow> debugfs_rows_;
  ExactnessReport report_;
  /// Counts the owner's reports; an audit that began before the newest one is discarded.
  uint64_t reports_by_owner_ = 0;
};

}  // namespace lenticule::display
