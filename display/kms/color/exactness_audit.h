// SPDX-License-Identifier: Apache-2.0
// ExactnessAudit finds the properties that change pixels, lists the values to write, and checks the
// result. Facts about an output that are not properties come from sysfs, readable by every user,
// and from debugfs, readable by root.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "display/kms/color/exactness_report.h"
#include "display/kms/color/exactness_rules.h"
#include "display/kms/device/drm_properties.h"
#include "display/kms/device/platform.h"
#include "display/kms/probe/output_choice.h"
#include "display/scanout_depth.h"

namespace lenticule::display {

/// Names of rows that other code looks up.
inline constexpr const char* kDepthRow = "depth and dithering";
inline constexpr const char* kCompressionRow = "DSC";

/// Returns a row for each sysfs file that could be read and parsed. `card` is the path of the
/// card's node, /dev/dri/cardN.
[[nodiscard]] std::vector<AuditRow> read_sysfs_rows(KmsPlatform& platform, const std::string& card,
                                                    const Pipe& pipe);
/// Returns a row for each debugfs file that could be read and parsed. The driver takes locks to
/// answer, so call it only while no flips are pending.
[[nodiscard]] std::vector<AuditRow> read_debugfs_rows(KmsPlatform& platform,
                                                      const std::string& card, const Pipe& pipe);

struct PipeTables {
  PropertyTable connector;
  PropertyTable crtc;
  PropertyTable plane;

  [[nodiscard]] const PropertyTable& of(KmsObject object) const;
  /// Reads the properties; none if one of the objects no longer exists.
  [[nodiscard]] static std::optional<PipeTables> read(int fd, uint32_t connector, uint32_t crtc,
                                                      uint32_t plane);
};

/// Returns true if a property that was neutral in `before` is not neutral in `after`.
[[nodiscard]] bool lost_a_setting(const ExactnessReport& before, const ExactnessReport& after);

/// ExactnessAudit finds the properties that change pixels, lists the values to write, and checks
/// the result.
class ExactnessAudit {
 public:
  /// `depth` is that of the frames which are scanned out.
  ExactnessAudit(const PipeTables& found, ScanoutDepth depth);

  /// Returns the properties to write at a modeset, except refused ones.
  [[nodiscard]] std::vector<PropertySetting> settings() const;
  /// Marks a setting as refused or not, in order to find out which ones a driver rejects.
  void set_refused(size_t index, bool refused);
  [[nodiscard]] size_t count() const { return items_.size(); }

  /// Returns the report. `now` holds the properties read after the commit; none if there was no
  /// commit (`doctor`). `further` are rows about facts that are not properties.
  [[nodiscard]] ExactnessReport report(const Pipe& pipe, const std::string& driver,
                                       const std::optional<PipeTables>& now,
                                       const std::vector<AuditRow>& further) const;

 private:
  struct Item {
    const ExactnessRule* rule = nullptr;
    Property found;
    uint32_t object = 0;
    std::optional<uint64_t> wanted;
    bool settable = false;
    bool refused = false;

    /// Returns true if `value` limits the link to fewer bits than the frames have.
    [[nodiscard]] bool has_too_few_bits(uint64_t value) const {
      return settable && rule->neutral == Neutral::Depth && found.is_range() && value < *wanted;
    }
  };

  [[nodiscard]] AuditRow row_of(const Item& item, const std::optional<PipeTables>& now) const;

  std::vector<Item> items_;
  std::vector<Item> leftovers_;  ///< settings that cannot be written
};

}  // namespace lenticule::display
