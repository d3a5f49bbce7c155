// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/open_kms.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "base/error.h"
#include "display/kms/device/drm_device.h"
#include "display/kms/probe/card_survey.h"
#include "display/kms/probe/mode_choice.h"
#include "display/kms/probe/output_choice.h"
#include "display/kms/scanout/inherit_output.h"

namespace lenticule::display {
namespace {

/// Finds the requested panel and its card.
std::pair<DrmDevice, ConnectorInfo> find_panel(const KmsOptions& options,
                                               std::optional<DrmDevice>& inherited) {
  CardSurvey survey = survey_cards(options.session, inherited);
  const OutputChoice choice = choose_output(options.wish, survey.candidates);
  if (!choice.chosen) throw refusal(choice, survey);
  const size_t index = *choice.chosen;
  return {std::move(survey.devices[*survey.device_of[index]]),
          std::move(survey.candidates[index].connector)};
}

void require_master(const DrmDevice& device) {
  switch (device.session().ensure_master(device.fd())) {
    case Mastership::Held:
      return;
    case Mastership::Denied:
      throw Error(ErrorKind::Device,
                  fmt::format("{}: cannot become DRM master: permission denied", device.path()),
                  "another program opened it first: stop the desktop session, plymouth or the "
                  "other player ('fuser -v' on the card names it)");
    case Mastership::Busy:
      throw Error(ErrorKind::Device,
                  fmt::format("{}: cannot become DRM master: in use", device.path()),
                  "stop the desktop session, plymouth or the other player ('fuser -v' on the card "
                  "names it)");
  }
}

void require_caps(const DrmDevice& device) {
  const DrmCaps& caps = device.caps();
  if (caps.sufficient()) return;
  const char* const missing = !caps.atomic                 ? "atomic modesetting"
                              : !caps.dumb_buffers         ? "dumb buffers"
                              : !caps.monotonic_timestamps ? "monotonic timestamps"
                                                           : "the CRTC in its events";
  throw Error(ErrorKind::Device,
              fmt::format("{}: driver {} has not {}", device.path(), device.driver(), missing),
              "use a card with a kernel modesetting driver (nvidia: nvidia_drm.modeset=1)");
}

LitOutput light_new_output(const KmsOptions& options, std::optional<DrmDevice> inherited) {
  auto [device, connector] = find_panel(options, inherited);
  require_caps(device);
  require_master(device);
  OutputTarget target{.connector = std::move(connector)};
  target.mode = require_mode(target.connector, options.wish.panel, options.refresh);
  target.pipe = choose_pipe(device.fd(), target.connector);

  LitOutput lit;
  lit.output = std::make_unique<KmsOutput>(std::move(device), std::move(target), options.platform);
  lit.output->foresee();
  // Checked before a frame is shown, as far as the facts are known.
  require_exact(options, *lit.output);
  lit.buffers = make_scanout_pool(lit.output->device().fd(), options.platform, options.wish.panel,
                                  options.buffers);
  lit.front = lit.buffers.front().get();
  lit.output->light_up(lit.front->framebuffer(), *options.clock,
                       options.fresh ? RunningMode::SetAnew : RunningMode::TakeOver);
  return lit;
}

}  // namespace

void require_exact(const KmsOptions& options, const KmsOutput& output) {
  const ExactnessReport report = output.report();
  if (options.allow_inexact || report.verdict != Verdict::No) return;
  std::string why;
  for (const std::string& reason : report.reasons) why += (why.empty() ? "" : "; ") + reason;
  std::string hint;
  for (const std::string& remedy : report.remedies) hint += remedy + ", or ";
  throw Error(ErrorKind::Quality,
              fmt::format("{} on {}: subpixels would not arrive as they are: {}",
                          output.target().connector.name, output.device().path(), why),
              hint + "show it all the same with --allow-inexact");
}

LitOutput light_output(const KmsOptions& options) {
  std::optional<DrmDevice> card;
  if (options.inherited && options.inherited->card)
    if (auto lit = inherit_output(options, card)) return std::move(*lit);
  return light_new_output(options, std::move(card));
}

}  // namespace lenticule::display
