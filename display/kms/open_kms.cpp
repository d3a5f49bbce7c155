// SPDX-License-Identifier: Apache-2.0
#include "display/kms/open_kms.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

#include "display/kms/drm_device.h"
#include "display/kms/drm_events.h"
#include "display/kms/mode_choice.h"
#include "display/kms/output_choice.h"
#include "optics/error.h"

namespace lenticule::display {
namespace {

constexpr Nanoseconds kLookAgain = std::chrono::seconds(1);

/// All cards that can be opened, and their connectors.
struct Survey {
  std::vector<DrmDevice> devices;
  std::vector<OutputCandidate> candidates;
  std::vector<size_t> device_of;  ///< per candidate
  std::optional<Error> problem;   ///< of a card that could not be opened
};

void survey_device(Survey& survey, DrmDevice device) {
  for (ConnectorInfo& connector : read_connectors(device.fd(), Probe::Full)) {
    survey.candidates.push_back({device.path(), std::move(connector)});
    survey.device_of.push_back(survey.devices.size());
  }
  survey.devices.push_back(std::move(device));
}

/// `inherited` is used up where it is one of the cards: it is master already.
Survey survey_cards(const std::shared_ptr<Session>& session, std::optional<DrmDevice>& inherited) {
  Survey survey;
  for (const DrmNode& node : find_drm_nodes()) {
    try {
      if (inherited && inherited->fd() >= 0 && same_device(inherited->path(), node.path))
        survey_device(survey, std::move(*inherited));
      else
        survey_device(survey, DrmDevice::open(session, node));
    } catch (const Error& error) {
      survey.problem = error;
    }
  }
  return survey;
}

[[noreturn]] void throw_choice(const OutputChoice& choice, const Survey& survey) {
  if (!survey.problem) throw Error(choice.kind, choice.cause, choice.remedy);
  if (survey.candidates.empty()) throw Error(*survey.problem);
  throw Error(choice.kind, fmt::format("{} ({})", choice.cause, survey.problem->what()),
              choice.remedy);
}

/// Looks until the panel is there, the time is up or somebody cancels.
std::pair<DrmDevice, ConnectorInfo> find_panel(const KmsOptions& options,
                                               std::optional<DrmDevice>& inherited) {
  Clock& clock = *options.clock;
  const Nanoseconds give_up = clock.now() + options.wait_for_panel;
  while (true) {
    Survey survey = survey_cards(options.session, inherited);
    const OutputChoice choice = choose_output(options.wish, survey.candidates);
    if (choice.chosen) {
      const size_t index = *choice.chosen;
      return {std::move(survey.devices[survey.device_of[index]]),
              std::move(survey.candidates[index].connector)};
    }
    if (!choice.may_come || clock.now() >= give_up) throw_choice(choice, survey);
    // The cards are closed meanwhile: a panel may come on one that others need.
    survey.devices.clear();
    const Nanoseconds until = std::min(clock.now() + kLookAgain, give_up);
    if (clock.wait_until(until, options.cancel_fd) == WaitResult::Woken)
      throw Error(ErrorKind::Device, "kms: interrupted while waiting for a panel");
  }
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
  lit.output = std::make_unique<KmsOutput>(std::move(device), std::move(target));
  lit.buffers = make_scanout_pool(lit.output->device().fd(), options.platform, options.wish.panel,
                                  options.buffers);
  lit.front = lit.buffers.front().get();
  lit.output->light_up(lit.front->framebuffer(), *options.clock);
  return lit;
}

/// The panel of the state is there, and is still the rig's.
bool same_panel(const ConnectorInfo& connector, const KmsOptions& options) {
  const HandoverState& state = options.inherited->state;
  if (!connector.connected) return false;
  const std::string_view known(state.edid_sha256.data(), state.edid_sha256.size());
  if (connector.edid.identity ? connector.edid.identity->sha256 != known : known[0] != '\0')
    return false;
  OutputWish wish = options.wish;
  return choose_output(wish, {{state.card.data(), connector}}).chosen.has_value();
}

/// The kernel's plane shows one of the inherited buffers; which one.
KmsBuffer* buffer_on_glass(int fd, const HandoverState& state, const ScanoutPool& buffers) {
  const DrmPlane plane(drmModeGetPlane(fd, state.plane));
  if (!plane || plane->crtc_id != state.crtc) return nullptr;
  const auto found = std::find_if(buffers.begin(), buffers.end(), [&](const auto& buffer) {
    return buffer->framebuffer() == plane->fb_id;
  });
  return found == buffers.end() ? nullptr : found->get();
}

ScanoutPool inherit_buffers(int fd, const KmsOptions& options) {
  const HandoverState& state = options.inherited->state;
  ScanoutPool pool;
  for (uint32_t i = 0; i < state.buffer_count; ++i) {
    const HandoverState::Buffer& names = state.buffers[i];
    pool.push_back(std::make_unique<KmsBuffer>(
        fd, options.platform, options.wish.panel,
        ScanoutNames{names.handle, names.framebuffer, names.pitch, names.size}));
  }
  return pool;
}

/// Throws away events that were meant for the player before.
void drain_events(int fd) {
  struct Ignore final : DrmEventHandler {
    void on_drm_event(const DrmEvent& event) noexcept override { (void)event; }
  } ignore;
  for (int i = 0; i < 16; ++i) (void)read_drm_events(fd, ignore);
}

/// None when anything is not as the state says; then nothing of it was changed.
std::optional<LitOutput> try_inherit(const KmsOptions& options, DrmDevice& device) {
  const HandoverState& state = options.inherited->state;
  const frames::FrameGeometry panel = options.wish.panel;
  if (state.width != panel.width || state.height != panel.height) return std::nullopt;
  if (!device.caps().sufficient() ||
      device.session().ensure_master(device.fd()) != Mastership::Held)
    return std::nullopt;
  auto connector = read_connector(device.fd(), state.connector, Probe::Full);
  if (!connector || !same_panel(*connector, options)) return std::nullopt;
  const auto mode = choose_mode(connector->modes, panel, options.refresh);
  if (!mode) return std::nullopt;
  const Pipe pipe = choose_pipe(device.fd(), *connector);
  if (pipe.crtc != state.crtc || pipe.plane != state.plane) return std::nullopt;

  const int fd = device.fd();
  drain_events(fd);
  LitOutput lit;
  ScanoutPool buffers = inherit_buffers(fd, options);
  lit.front = buffer_on_glass(fd, state, buffers);
  lit.output = std::make_unique<KmsOutput>(
      std::move(device),
      OutputTarget{.connector = std::move(*connector), .mode = *mode, .pipe = pipe});
  lit.buffers = std::move(buffers);
  if (lit.front == nullptr) lit.front = lit.buffers.front().get();
  lit.output->light_up(lit.front->framebuffer(), *options.clock);
  return lit;
}

/// The inherited card goes into `card` in any case, if it is one.
std::optional<LitOutput> inherit_output(const KmsOptions& options, std::optional<DrmDevice>& card) {
  InheritedOutput& inherited = *options.inherited;
  try {
    card.emplace(DrmDevice::adopt(options.session, std::move(inherited.card),
                                  std::string(inherited.state.card.data())));
    if (auto lit = try_inherit(options, *card)) return lit;
  } catch (const Error&) {
    // Not as it said: start afresh.
  }
  if (card && card->fd() >= 0) discard_buffers(card->fd(), inherited.state);
  return std::nullopt;
}

}  // namespace

LitOutput light_output(const KmsOptions& options) {
  std::optional<DrmDevice> card;
  if (options.inherited && options.inherited->card)
    if (auto lit = inherit_output(options, card)) return std::move(*lit);
  return light_new_output(options, std::move(card));
}

}  // namespace lenticule::display
