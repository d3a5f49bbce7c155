// SPDX-License-Identifier: Apache-2.0
#include "display/kms/exactness_audit.h"

#include <fmt/format.h>
#include <xf86drmMode.h>

#include <algorithm>
#include <array>
#include <string_view>

namespace lenticule::display {
namespace {

/// Drivers that send pictures compressed, or show old ones.
struct DriverFault {
  const char* driver;
  const char* cause;
};
constexpr std::array kDriverFaults = {
    DriverFault{"udl", "the USB adapter compresses pictures"},
    DriverFault{"evdi", "the USB adapter compresses pictures"},
    DriverFault{"gud", "the USB adapter may compress pictures"},
    DriverFault{"vmwgfx", "the driver may keep showing an old frame"},
};

bool has_link(uint32_t connector_type) {
  return connector_type != DRM_MODE_CONNECTOR_VIRTUAL &&
         connector_type != DRM_MODE_CONNECTOR_WRITEBACK;
}

bool names_encoding(const AuditRow& row) {
  return row.outcome != AuditOutcome::Refused && row.outcome != AuditOutcome::Foreign &&
         (row.property == "Output format" || row.property == "output_color_format" ||
          row.property == "color_format" || row.property == "color format");
}

bool forces_full_range(const AuditRow& row) {
  return row.property == "Broadcast RGB" && row.now == row.wanted;
}

bool is_hdmi(uint32_t type) {
  return type == DRM_MODE_CONNECTOR_HDMIA || type == DRM_MODE_CONNECTOR_HDMIB;
}

bool is_wrong(const AuditRow& row) {
  return row.outcome == AuditOutcome::Refused || row.outcome == AuditOutcome::ReadOnly;
}

void add(ExactnessReport& report, Verdict verdict, std::string reason, std::string remedy) {
  if (verdict == Verdict::No || report.verdict == Verdict::Yes) report.verdict = verdict;
  report.reasons.push_back(std::move(reason));
  if (!remedy.empty() &&
      std::find(report.remedies.begin(), report.remedies.end(), remedy) == report.remedies.end())
    report.remedies.push_back(std::move(remedy));
}

void judge_rows(ExactnessReport& report) {
  const std::vector<AuditRow> rows = report.rows;
  for (const AuditRow& row : rows) {
    const std::string fact =
        fmt::format("{} '{}' is {}: {}", row.object, row.property, row.now, row.effect);
    if (is_wrong(row) && row.alters_pixels) add(report, Verdict::No, fact, row.remedy);
    if (row.outcome == AuditOutcome::Foreign && row.alters_pixels)
      add(report, Verdict::Unknown, fact + " unless that value is neutral", row.remedy);
  }
}

void judge_driver(ExactnessReport& report, const LinkFacts& link) {
  for (const DriverFault& fault : kDriverFaults)
    if (link.driver == fault.driver)
      add(report, Verdict::No, fmt::format("driver {}: {}", fault.driver, fault.cause),
          "use an output of a graphics card");
}

void judge_link(ExactnessReport& report, const LinkFacts& link) {
  if (!has_link(link.connector_type)) return;
  const auto any = [&](bool (*test)(const AuditRow&)) {
    return std::any_of(report.rows.begin(), report.rows.end(), test);
  };
  if (!any(names_encoding) && (link.offers_ycbcr || !link.edid_known))
    add(report, Verdict::Unknown,
        link.edid_known ? "the panel also takes YCbCr, and the driver does not say what it sends"
                        : "without a valid EDID nobody knows what the link carries",
        "use DisplayPort, or an EDID that offers RGB only (drm.edid_firmware=)");
  if (is_hdmi(link.connector_type) && !any(forces_full_range))
    add(report, Verdict::Unknown, "the driver cannot be told to send the full range of values",
        "set the panel's input to full range, and use its own mode rather than a television one");
  add(report, Verdict::Unknown, "bits per colour and dithering of the link cannot be read back",
      "look at a test card of single-step ramps, and read output_bpc in debugfs as root");
}

}  // namespace

const char* verdict_name(Verdict verdict) {
  switch (verdict) {
    case Verdict::Yes:
      return "yes";
    case Verdict::No:
      return "no";
    case Verdict::Unknown:
      return "unknown";
  }
  return "?";
}

const char* outcome_name(AuditOutcome outcome) {
  switch (outcome) {
    case AuditOutcome::Neutral:
      return "neutral";
    case AuditOutcome::Forced:
      return "forced";
    case AuditOutcome::Planned:
      return "would be forced";
    case AuditOutcome::Refused:
      return "refused";
    case AuditOutcome::ReadOnly:
      return "read only";
    case AuditOutcome::Foreign:
      return "no neutral value known";
  }
  return "?";
}

std::string ExactnessReport::summary() const {
  std::string text = fmt::format("EXACT {}", verdict_name(verdict));
  for (size_t i = 0; i < reasons.size(); ++i) text += (i == 0 ? " (" : "; ") + reasons[i];
  return reasons.empty() ? text : text + ")";
}

const PropertyTable& PipeTables::of(KmsObject object) const {
  if (object == KmsObject::Connector) return connector;
  return object == KmsObject::Crtc ? crtc : plane;
}

std::optional<PipeTables> PipeTables::read(int fd, uint32_t connector, uint32_t crtc,
                                           uint32_t plane) {
  auto connector_table = PropertyTable::read(fd, connector, DRM_MODE_OBJECT_CONNECTOR);
  auto crtc_table = PropertyTable::read(fd, crtc, DRM_MODE_OBJECT_CRTC);
  auto plane_table = PropertyTable::read(fd, plane, DRM_MODE_OBJECT_PLANE);
  if (!connector_table || !crtc_table || !plane_table) return std::nullopt;
  return PipeTables{std::move(*connector_table), std::move(*crtc_table), std::move(*plane_table)};
}

ExactnessAudit::ExactnessAudit(const PipeTables& found) {
  for (const ExactnessRule& rule : exactness_rules()) {
    const PropertyTable& table = found.of(rule.object);
    const Property* property = table.find(rule.property);
    if (property == nullptr) continue;
    const auto wanted = neutral_value(rule, *property);
    if (wanted && property->writable() && rule.neutral != Neutral::Kept)
      items_.push_back({&rule, *property, table.object(), *wanted});
    else
      leftovers_.push_back({&rule, *property, wanted});
  }
}

std::vector<PropertySetting> ExactnessAudit::settings() const {
  std::vector<PropertySetting> settings;
  for (const Item& item : items_)
    if (!item.refused) settings.push_back({item.object, item.found.id, item.wanted});
  return settings;
}

void ExactnessAudit::set_refused(size_t index, bool refused) {
  items_.at(index).refused = refused;
}

AuditRow ExactnessAudit::row_of(const Item& item, const std::optional<PipeTables>& now) const {
  const Property* after = now ? now->of(item.rule->object).find(item.rule->property) : nullptr;
  const uint64_t value = after != nullptr ? after->value : item.found.value;
  AuditRow row{.object = object_name(item.rule->object),
               .property = item.found.name,
               .found = item.found.text_of(item.found.value),
               .wanted = item.found.text_of(item.wanted),
               .now = item.found.text_of(value),
               .alters_pixels = item.rule->harm == Harm::Pixels,
               .effect = item.rule->effect,
               .remedy = item.rule->remedy};
  if (value == item.wanted)
    row.outcome = item.found.value == item.wanted ? AuditOutcome::Neutral : AuditOutcome::Forced;
  else
    row.outcome = now || item.refused ? AuditOutcome::Refused : AuditOutcome::Planned;
  return row;
}

AuditRow ExactnessAudit::row_of(const Leftover& leftover) const {
  const std::string found = leftover.found.text_of(leftover.found.value);
  const bool neutral = leftover.wanted == leftover.found.value;
  return {.object = object_name(leftover.rule->object),
          .property = leftover.found.name,
          .found = found,
          .wanted = leftover.wanted ? leftover.found.text_of(*leftover.wanted) : "?",
          .now = found,
          .outcome = neutral           ? AuditOutcome::Neutral
                     : leftover.wanted ? AuditOutcome::ReadOnly
                                       : AuditOutcome::Foreign,
          .alters_pixels = leftover.rule->harm == Harm::Pixels,
          .effect = leftover.rule->effect,
          .remedy = leftover.rule->remedy};
}

ExactnessReport ExactnessAudit::report(const LinkFacts& link, const std::optional<PipeTables>& now,
                                       const std::vector<AuditRow>& further) const {
  ExactnessReport report{.verdict = Verdict::Yes};
  for (const Item& item : items_) report.rows.push_back(row_of(item, now));
  for (const Leftover& leftover : leftovers_) report.rows.push_back(row_of(leftover));
  report.rows.insert(report.rows.end(), further.begin(), further.end());
  judge_rows(report);
  judge_driver(report, link);
  judge_link(report, link);
  return report;
}

}  // namespace lenticule::display
