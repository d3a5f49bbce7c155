// SPDX-License-Identifier: Apache-2.0
// Finds the properties that change pixels, says what to write, and checks what came of it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "display/kms/color/exactness_report.h"
#include "display/kms/color/exactness_rules.h"
#include "display/kms/device/atomic_request.h"
#include "display/kms/device/drm_properties.h"

namespace lenticule::display {

struct PipeTables {
  PropertyTable connector;
  PropertyTable crtc;
  PropertyTable plane;

  [[nodiscard]] const PropertyTable& of(KmsObject object) const;
  /// None if one of the objects is gone.
  [[nodiscard]] static std::optional<PipeTables> read(int fd, uint32_t connector, uint32_t crtc,
                                                      uint32_t plane);
};

/// What happens beside and after the scan-out, beyond any property.
struct LinkFacts {
  uint32_t connector_type = 0;  ///< DRM_MODE_CONNECTOR_*
  std::string driver;
  bool edid_known = false;
  bool offers_ycbcr = false;
  /// The panel takes this mode as YCbCr 4:2:0 and not otherwise.
  bool only_as_420 = false;
  std::optional<int> bits_per_colour;
  /// The EDID calls another size the panel's own.
  bool other_native_size = false;
  /// None when nothing was committed.
  std::optional<bool> one_to_one;
};

/// True if a property that was neutral in `before` is not in `after`.
[[nodiscard]] bool lost_a_setting(const ExactnessReport& before, const ExactnessReport& after);

class ExactnessAudit {
 public:
  explicit ExactnessAudit(const PipeTables& found);

  /// Everything to be written at a modeset, except what was refused.
  [[nodiscard]] std::vector<PropertySetting> settings() const;
  /// Gives up this one, or takes it back: to find out which ones a driver dislikes.
  void set_refused(size_t index, bool refused);
  [[nodiscard]] size_t count() const { return items_.size(); }

  /// `now` as read after the commit; none when nothing was committed (`doctor`). `further` are rows
  /// about what is no property.
  [[nodiscard]] ExactnessReport report(const LinkFacts& link, const std::optional<PipeTables>& now,
                                       const std::vector<AuditRow>& further) const;

 private:
  struct Item {
    const ExactnessRule* rule = nullptr;
    Property found;
    uint32_t object = 0;
    uint64_t wanted = 0;
    bool refused = false;
  };
  struct Leftover {  ///< what cannot be written at all
    const ExactnessRule* rule = nullptr;
    Property found;
    std::optional<uint64_t> wanted;
  };

  [[nodiscard]] AuditRow row_of(const Item& item, const std::optional<PipeTables>& now) const;
  [[nodiscard]] AuditRow row_of(const Leftover& leftover,
                                const std::optional<PipeTables>& now) const;

  std::vector<Item> items_;
  std::vector<Leftover> leftovers_;
};

}  // namespace lenticule::display
