// SPDX-License-Identifier: Apache-2.0
#include "display/kms/color/legacy_gamma.h"

#include <bit>

#include "display/kms/color/exactness_rules.h"

namespace lenticule::display {
namespace {

constexpr int kMostEntries = 65536;

size_t entries_of(int fd, const PropertyTable& crtc) {
  // If either property exists, the kernel makes the ramp an alias of it, and the audit resets the
  // property.
  if (crtc.find("GAMMA_LUT") != nullptr || crtc.find("DEGAMMA_LUT") != nullptr) return 0;
  const DrmCrtc source(drmModeGetCrtc(fd, crtc.object()));
  if (!source || source->gamma_size < 2 || source->gamma_size > kMostEntries) return 0;
  return static_cast<size_t>(source->gamma_size);
}

/// Returns the left-aligned bits of the index, as the kernel fills a new ramp: correct both for
/// hardware that truncates the low bits and for hardware that rounds. Other lengths are stretched
/// over the range.
uint16_t linear_value(size_t index, size_t entries) {
  const bool stretched = !std::has_single_bit(entries);
  return static_cast<uint16_t>(stretched ? index * 65535 / (entries - 1) : index * 65536 / entries);
}

}  // namespace

GammaRamp linear_ramp(size_t entries) {
  std::vector<uint16_t> values(entries);
  for (size_t i = 0; i < entries; ++i) values[i] = linear_value(i, entries);
  return {values, values, values};
}

LegacyGamma::LegacyGamma(int fd, const PropertyTable& crtc)
    : fd_(fd), crtc_(crtc.object()), linear_(linear_ramp(entries_of(fd, crtc))) {
  if (present()) found_ = read();
}

std::optional<GammaRamp> LegacyGamma::read() const {
  GammaRamp ramp = linear_;
  const auto entries = static_cast<uint32_t>(ramp.red.size());
  if (drmModeCrtcGetGamma(fd_, crtc_, entries, ramp.red.data(), ramp.green.data(),
                          ramp.blue.data()) != 0)
    return std::nullopt;
  return ramp;
}

int LegacyGamma::write(const GammaRamp& ramp) const noexcept {
  // libdrm only reads the values; later versions declare them const.
  const auto values = [](const std::vector<uint16_t>& of) {
    return const_cast<uint16_t*>(of.data());
  };
  return drmModeCrtcSetGamma(fd_, crtc_, static_cast<uint32_t>(ramp.red.size()), values(ramp.red),
                             values(ramp.green), values(ramp.blue));
}

int LegacyGamma::make_linear() const noexcept {
  // A ramp that could not be read could not be restored, so it is not changed.
  return present() && found_ ? write(linear_) : 0;
}

std::optional<AuditRow> LegacyGamma::row(bool committed) const {
  if (!present()) return std::nullopt;
  const auto text_of = [&](const std::optional<GammaRamp>& ramp) {
    return !ramp ? "unreadable" : *ramp == linear_ ? "linear" : "set";
  };
  const std::optional<GammaRamp> now = read();
  AuditRow row{.object = object_name(KmsObject::Crtc),
               .property = kGammaRampRow,
               .found = text_of(found_),
               .wanted = "linear",
               .now = text_of(now),
               .alters_pixels = true,
               .effect = "values are mapped to other values",
               .remedy = "switch night lights and colour profiles off"};
  if (!found_ || !now)
    row.outcome = AuditOutcome::Foreign;
  else if (*now == linear_)
    row.outcome = *found_ == linear_ ? AuditOutcome::Neutral : AuditOutcome::Forced;
  else
    row.outcome = committed ? AuditOutcome::Refused : AuditOutcome::Planned;
  return row;
}

}  // namespace lenticule::display
