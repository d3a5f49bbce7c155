// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/inherit_output.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "display/kms/device/drm_events.h"
#include "display/kms/probe/mode_choice.h"
#include "display/kms/probe/output_choice.h"

namespace lenticule::display {
namespace {

template <size_t N>
void copy_text(const std::string& text, std::array<char, N>& to) noexcept {
  std::memcpy(to.data(), text.data(), std::min(text.size(), N));
}

/// Returns true if the state's panel is connected and still matches the rig.
bool same_panel(const ConnectorInfo& connector, const KmsOptions& options) {
  const HandoverState& state = options.inherited->state;
  if (!connector.connected) return false;
  const std::string_view known(state.edid_sha256.data(), state.edid_sha256.size());
  if (connector.edid.identity ? connector.edid.identity->sha256 != known : known[0] != '\0')
    return false;
  OutputWish wish = options.wish;
  return choose_output(wish, {{state.card.data(), connector}}).chosen.has_value();
}

/// Returns the inherited buffer that the kernel's plane shows; null if none.
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

/// Discards events that were meant for the previous player.
void drain_events(int fd) {
  struct Ignore final : DrmEventHandler {
    void on_drm_event(const DrmEvent& event) noexcept override { (void)event; }
  } ignore;
  for (int i = 0; i < 16; ++i) (void)read_drm_events(fd, ignore);
}

/// Tries to take over. Returns none, without changing the output, if any part does not match the
/// state.
std::optional<LitOutput> try_inherit(const KmsOptions& options, DrmDevice& device) {
  const HandoverState& state = options.inherited->state;
  const frames::FrameGeometry panel = options.wish.panel;
  if (state.width != panel.width || state.height != panel.height) return std::nullopt;
  if (!device.caps().sufficient() ||
      device.session().ensure_master(device.fd()) != Mastership::Held)
    return std::nullopt;
  auto connector = read_connector(device.fd(), state.connector, Probe::Full);
  if (!connector || !same_panel(*connector, options)) return std::nullopt;
  const auto mode = choose_mode(*connector, panel, options.refresh);
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
      OutputTarget{.connector = std::move(*connector), .mode = *mode, .pipe = pipe},
      options.platform);
  lit.buffers = std::move(buffers);
  if (lit.front == nullptr) lit.front = lit.buffers.front().get();
  lit.output->light_up(lit.front->framebuffer(), *options.clock, RunningMode::TakeOver);
  return lit;
}

}  // namespace

HandoverState describe_output(const LitOutput& lit, frames::FrameGeometry geometry) {
  HandoverState state;
  const OutputTarget& target = lit.output->target();
  state.connector = target.connector.id;
  state.crtc = target.pipe.crtc;
  state.plane = target.pipe.plane;
  state.width = geometry.width;
  state.height = geometry.height;
  state.buffer_count = static_cast<uint32_t>(lit.buffers.size());
  for (size_t i = 0; i < lit.buffers.size(); ++i) {
    const ScanoutNames names = lit.buffers[i]->names();
    state.buffers.at(i) = {names.handle, names.framebuffer, names.pitch, 0, names.size};
  }
  if (target.connector.edid.identity)
    copy_text(target.connector.edid.identity->sha256, state.edid_sha256);
  copy_text(lit.output->device().path(), state.card);
  state.card.back() = '\0';
  return state;
}

std::optional<LitOutput> inherit_output(const KmsOptions& options, std::optional<DrmDevice>& card) {
  InheritedOutput& inherited = *options.inherited;
  try {
    card.emplace(DrmDevice::adopt(options.session, std::move(inherited.card),
                                  std::string(inherited.state.card.data())));
    if (!options.fresh)
      if (auto lit = try_inherit(options, *card)) return lit;
  } catch (const Error&) {
    // The state does not match: start from scratch.
  }
  if (card && card->fd() >= 0) discard_buffers(card->fd(), inherited.state);
  return std::nullopt;
}

}  // namespace lenticule::display
