// SPDX-License-Identifier: Apache-2.0
#include "display/open/open_display.h"

#include <utility>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "display/kms/probe/output_request.h"
#include "display/scanout_format.h"
#include "display/virtual/virtual_display.h"

namespace lenticule::display {
namespace {

constexpr int64_t kMaxJitterUs = 10'000'000;

[[noreturn]] void reject(std::string_view spec) {
  throw usage_error("display '{}': not understood", spec)
      .remedy("write virtual, virtual:3840x2160@60, kms or kms:CONNECTOR");
}

bool parse_mode(std::string_view mode, VirtualSpec& out) {
  const bool has_refresh = mode.find('@') != std::string_view::npos;
  const auto size = numbers_from<int, 2>(take_until(mode, '@'), 'x');
  if (has_refresh) out.refresh = frames::parse_rate(mode);
  if (!size || (*size)[0] < 1 || (*size)[1] < 1) return false;
  out.width = (*size)[0];
  out.height = (*size)[1];
  return true;
}

bool parse_option(std::string_view option, VirtualSpec& out) {
  const std::string_view key = take_until(option, '=');
  if (key == "jitter_us") {
    const auto value = number_from<int64_t>(option);
    if (!value || *value < 0 || *value > kMaxJitterUs) return false;
    out.jitter_us = *value;
    return true;
  }
  const auto value = number_from<uint64_t>(option);
  if (key != "seed" || !value) return false;
  out.seed = *value;
  return true;
}

std::unique_ptr<Display> open_virtual(const DisplayRequest& request) {
  const VirtualSpec spec = parse_virtual_spec(request.spec);
  const frames::FrameGeometry panel = turned(request.panel, request.mounting);
  frames::FrameGeometry geometry = panel;
  if (spec.width > 0) {
    geometry.width = spec.width;
    geometry.height = spec.height;
  }
  if (geometry != panel)
    throw input_error("display '{}': {}x{} pixels, but the rig's panel has {}x{}", request.spec,
                      geometry.width, geometry.height, panel.width, panel.height)
        .remedy("woven frames fit one panel, pixel for pixel: use the rig of this display");
  std::vector<ScanoutPart> parts;
  for (const OutputPart& part : request.parts) parts.push_back(part.place);
  return open_virtual_display(
      {.geometry = geometry,
       .mounting = request.mounting,
       .depth = request.depth,
       .parts = std::move(parts),
       .refresh = spec.refresh,
       .buffers = request.buffers,
       .clock = request.clock,
       .event_delay = spec.jitter_us > 0
                          ? uniform_jitter(std::chrono::microseconds(spec.jitter_us), spec.seed)
                          : nullptr,
       .recorder = request.recorder});
}

}  // namespace

VirtualSpec parse_virtual_spec(std::string_view spec) {
  constexpr std::string_view kName = "virtual";
  VirtualSpec result;
  std::string_view rest = spec;
  if (!rest.starts_with(kName)) reject(spec);
  rest.remove_prefix(kName.size());
  if (rest.starts_with(':')) {
    rest.remove_prefix(1);
    if (!parse_mode(take_until(rest, ','), result)) reject(spec);
  } else if (rest.starts_with(',')) {
    rest.remove_prefix(1);
  } else if (!rest.empty()) {
    reject(spec);
  }
  while (!rest.empty())
    if (!parse_option(take_until(rest, ','), result)) reject(spec);
  return result;
}

bool is_kms_spec(std::string_view spec) { return spec.substr(0, spec.find(':')) == "kms"; }

void check_display_spec(std::string_view spec) {
  if (is_kms_spec(spec))
    (void)parse_kms_spec(spec);
  else
    (void)parse_virtual_spec(spec);
}

KmsOptions kms_options_of(const DisplayRequest& request) {
  KmsOptions options = request.kms;
  options.output = parse_kms_spec(request.spec, options.output);
  options.output.panel = turned(request.panel, request.mounting);
  options.output.depth = request.depth;
  options.output.parts = request.parts;
  options.mounting = request.mounting;
  options.buffers = request.buffers;
  if (request.recorder)
    throw usage_error("display '{}': cannot record displayed frames", request.spec)
        .remedy("record with --display virtual");
  return options;
}

ScanoutDepth depth_of(int bits) {
  return bits == optics::kDeepBits ? ScanoutDepth::Bits10 : ScanoutDepth::Bits8;
}

DisplayRequest request_for(const optics::Rig& rig, const std::string& spec) {
  DisplayRequest request{.spec = spec,
                         .panel = {.width = rig.panel.width_px, .height = rig.panel.height_px},
                         .mounting = rig.panel.mounting,
                         .depth = depth_of(rig.panel.bits)};
  request.kms.output.identity = rig.identity;
  return request;
}

std::unique_ptr<Display> open_display(const DisplayRequest& request) {
  return is_kms_spec(request.spec) ? open_kms_display(kms_options_of(request))
                                   : open_virtual(request);
}

}  // namespace lenticule::display
