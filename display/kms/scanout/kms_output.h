// SPDX-License-Identifier: Apache-2.0
// One connector, CRTC and primary plane that show one framebuffer at a time, pixel for pixel. Knows
// how to ask the kernel; when to ask is the display's business.
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
#include "display/kms/probe/pipe_choice.h"

namespace lenticule::display {

struct OutputTarget {
  ConnectorInfo connector;
  drmModeModeInfo mode{};
  Pipe pipe{};
};

/// What becomes of a mode that the panel runs in already.
enum class RunningMode { TakeOver, SetAnew };

/// How far a repeated audit looks.
enum class AuditDepth {
  Properties,  ///< and sysfs: costs flips nothing
  Everything,  ///< the driver's debug files too, for which it takes its locks
};

/// Calls that return int return 0 or a negative errno, and do not throw. One thread, except
/// report() and audit_again().
class KmsOutput {
 public:
  /// Throws Error(Device) when the driver lacks what atomic modesetting needs.
  KmsOutput(DrmDevice device, OutputTarget target, std::shared_ptr<KmsPlatform> platform);

  /// The first picture: without a modeset if the panel runs in this mode already and may be taken
  /// over, else with one that was tested before. Forces every property of the audit that the driver
  /// lets be forced. Throws Error(Device).
  void light_up(uint32_t framebuffer, Clock& clock, RunningMode running);
  /// Takes over a picture that shows already, without a modeset. False if the kernel would need
  /// one.
  [[nodiscard]] bool take_over(uint32_t framebuffer);

  /// Makes a report of what can be known before anything is tested or shown.
  void foresee() { update_report(std::nullopt); }
  /// What light_up() would do, asked of the driver but not done: 0 or a negative errno. The report
  /// then says what would be forced and what would be refused.
  [[nodiscard]] int rehearse(uint32_t framebuffer);

  /// Asks for the next vblank; `id` comes back in the event.
  [[nodiscard]] int flip(uint32_t framebuffer, uint64_t id) noexcept;
  /// Waits until it shows; no modeset.
  [[nodiscard]] int show(uint32_t framebuffer) noexcept;
  /// A whole modeset, waited for.
  [[nodiscard]] int relight(uint32_t framebuffer) noexcept;
  /// What the panel says by now, for reports.
  void renew_connector(ConnectorInfo connector);
  /// Switches the CRTC off.
  [[nodiscard]] int blank() noexcept;
  /// Puts back what light_up() found.
  bool restore() noexcept;

  [[nodiscard]] const DrmDevice& device() const { return device_; }
  [[nodiscard]] const OutputTarget& target() const { return target_; }
  /// The driver's vblank count and its time, if it counts.
  [[nodiscard]] int read_sequence(uint64_t& sequence, Nanoseconds& time) const noexcept;
  [[nodiscard]] int queue_sequence(uint64_t sequence, uint64_t id) const noexcept;
  /// Whether light_up() could do without a modeset.
  [[nodiscard]] bool took_over() const { return took_over_; }
  /// Any thread.
  [[nodiscard]] ExactnessReport report() const;
  /// Reads everything again and renews the report; changes nothing on the output. True if a
  /// property that was neutral is not any more, so that relight() would help. Any thread, once
  /// light_up() or take_over() has returned; flips do not wait for it.
  [[nodiscard]] bool audit_again(AuditDepth depth);

 private:
  [[nodiscard]] std::vector<PropertySetting> plane_settings(uint32_t framebuffer) const;
  [[nodiscard]] std::vector<PropertySetting> mode_settings() const;
  [[nodiscard]] std::vector<PropertySetting> unlink_settings() const;
  [[nodiscard]] std::vector<PropertySetting> everything(uint32_t framebuffer) const;
  [[nodiscard]] int commit(const std::vector<PropertySetting>& settings, uint32_t flags) const;
  [[nodiscard]] bool runs_in_our_mode() const;
  [[nodiscard]] bool placed_one_to_one(const PipeTables& tables) const;
  [[nodiscard]] int test(uint32_t framebuffer);
  void find_refused_settings(uint32_t framebuffer);
  [[noreturn]] void fail(int error) const;
  void remember(uint32_t framebuffer);
  void settle();
  [[nodiscard]] LinkFacts link_facts() const;
  [[nodiscard]] ExactnessReport make_report(const std::optional<PipeTables>& now, AuditDepth depth);
  void update_report(const std::optional<PipeTables>& now);

  DrmDevice device_;
  OutputTarget target_;
  PipeTables tables_;  ///< as found
  ExactnessAudit audit_;
  LegacyGamma gamma_;
  BlobId mode_blob_;
  SavedState saved_;
  AtomicRequest flip_request_;
  uint32_t framebuffer_property_ = 0;
  bool took_over_ = false;

  std::shared_ptr<KmsPlatform> platform_;

  mutable std::mutex mutex_;  ///< guards the following
  LinkFacts link_;
  LinkPlace place_;
  std::vector<AuditRow> debugfs_rows_;
  ExactnessReport report_;
  uint64_t reports_by_owner_ = 0;  ///< one that an audit began before is older, and dropped
};

}  // namespace lenticule::display
