// SPDX-License-Identifier: Apache-2.0
// ActiveOutput is an output that shows frames, with its scan-out buffers. It is opened by taking
// over the buffers or the mode of the previous user of the card, or by a modeset.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "display/display.h"
#include "display/kms/device/drm_device.h"
#include "display/kms/device/drm_events.h"
#include "display/kms/device/drm_properties.h"
#include "display/kms/device/platform.h"
#include "display/kms/probe/output_choice.h"
#include "display/kms/scanout/kms_display.h"
#include "display/kms/scanout/kms_output.h"
#include "display/scanout_format.h"

namespace lenticule::display {

enum class ScanoutState { Free, Acquired, Pending, Displayed };

struct ScanoutUnmap {
  std::shared_ptr<KmsPlatform> platform;
  size_t size = 0;
  void operator()(void* memory) const noexcept { platform->unmap(memory, size); }
};
/// ScanoutMapping owns the memory mapping of a scan-out buffer.
using ScanoutMapping = std::unique_ptr<void, ScanoutUnmap>;

inline constexpr uint32_t kBitsPerPixel = 32;

[[noreturn]] inline void fail(const char* what, int error) {
  throw failed_error("kms: cannot {} a scan-out buffer: {}", what, std::strerror(error))
      .remedy("use fewer buffers, or give the card more memory");
}

inline bool holds(frames::FrameGeometry geometry, uint32_t pitch, uint64_t size) {
  const auto width = static_cast<uint64_t>(geometry.width);
  const auto height = static_cast<uint64_t>(geometry.height);
  return pitch % sizeof(uint32_t) == 0 && pitch >= width * sizeof(uint32_t) &&
         size >= uint64_t{pitch} * height;
}

inline FramebufferId add_framebuffer(int fd, const ScanoutLayout& layout, uint32_t handle,
                                     uint32_t pitch) {
  const uint32_t handles[4] = {handle};
  const uint32_t pitches[4] = {pitch};
  const uint32_t offsets[4] = {};
  uint32_t id = 0;
  const int error = drmModeAddFB2(fd, static_cast<uint32_t>(layout.geometry.width),
                                  static_cast<uint32_t>(layout.geometry.height),
                                  drm_format(layout.depth), handles, pitches, offsets, &id, 0);
  if (error != 0) fail("register", -error);
  return {fd, id};
}

inline ScanoutMapping map_buffer(int fd, const std::shared_ptr<KmsPlatform>& platform,
                                 uint32_t handle, uint64_t size) {
  uint64_t offset = 0;
  if (const int error = drmModeMapDumbBuffer(fd, handle, &offset); error != 0) fail("map", -error);
  void* const memory = platform->map(fd, offset, size);
  if (memory == nullptr) fail("map", errno);
  return {memory, {platform, size}};
}

class KmsBuffer final : public ScanoutBuffer {
 public:
  /// Creates a buffer and fills it with black, which touches every page. Throws Error(Failed) if
  /// the card or the system has no memory for it; frees everything that was created before the
  /// failure.
  KmsBuffer(int fd, std::shared_ptr<KmsPlatform> platform, const ScanoutLayout& layout)
      : layout_(layout) {
    const frames::FrameGeometry& geometry = layout.geometry;
    uint32_t handle = 0;
    const int error = drmModeCreateDumbBuffer(fd, static_cast<uint32_t>(geometry.width),
                                              static_cast<uint32_t>(geometry.height), kBitsPerPixel,
                                              0, &handle, &pitch_, &size_);
    if (error != 0) fail("create", -error);
    handle_ = DumbHandle(fd, handle);
    if (!holds(geometry, pitch_, size_)) fail("use", EINVAL);
    framebuffer_ = add_framebuffer(fd, layout, handle, pitch_);
    mapping_ = map_buffer(fd, platform, handle, size_);
    // Clears old contents of other programs, and touches every page so that no page fault delays a
    // frame.
    std::memset(mapping_.get(), 0, size_);
  }
  /// Wraps a buffer that another process created, keeping its contents. Takes ownership of the ids
  /// only on success.
  KmsBuffer(int fd, std::shared_ptr<KmsPlatform> platform, const ScanoutLayout& layout,
            const TakeoverState::Buffer& buffer)
      : layout_(layout), pitch_(buffer.pitch), size_(buffer.size) {
    if (!holds(layout.geometry, pitch_, size_)) fail("take over", EINVAL);
    mapping_ = map_buffer(fd, platform, buffer.handle, size_);
    handle_ = DumbHandle(fd, buffer.handle);
    framebuffer_ = FramebufferId(fd, buffer.framebuffer);
  }

  void fill(const frames::FrameView& frame) noexcept override {
    LENTICULE_CHECK(layout_.takes(frame));
    expand_frame(layout_, frame, static_cast<uint32_t*>(mapping_.get()), pitch_ / sizeof(uint32_t));
  }
  void fill_box(const frames::FrameView& box, int left, int top, size_t part) noexcept override {
    expand_box(layout_, box, left, top, part, static_cast<uint32_t*>(mapping_.get()),
               pitch_ / sizeof(uint32_t));
  }

  /// Changes Free to Acquired; returns false if the buffer is not free. The filling thread's only
  /// transition.
  [[nodiscard]] bool try_acquire() noexcept {
    ScanoutState expected = ScanoutState::Free;
    return state_.compare_exchange_strong(expected, ScanoutState::Acquired,
                                          std::memory_order_acq_rel);
  }
  void set_state(ScanoutState state) noexcept { state_.store(state, std::memory_order_release); }
  [[nodiscard]] ScanoutState state() const noexcept {
    return state_.load(std::memory_order_acquire);
  }
  [[nodiscard]] uint32_t framebuffer() const { return framebuffer_.get(); }
  /// Returns the ids with which another process can take over the buffer.
  [[nodiscard]] TakeoverState::Buffer takeover_buffer() const {
    return {
        .handle = handle_.get(), .framebuffer = framebuffer_.get(), .pitch = pitch_, .size = size_};
  }
  /// Unmaps the buffer, and leaves contents and ids to the process that holds the card's
  /// descriptor.
  void abandon() noexcept {
    handle_.abandon();
    framebuffer_.abandon();
  }

 private:
  ScanoutLayout layout_;
  uint32_t pitch_ = 0;
  uint64_t size_ = 0;
  DumbHandle handle_;          // destroyed third
  FramebufferId framebuffer_;  // destroyed second: the framebuffer on the handle
  ScanoutMapping mapping_;     // destroyed first: the mapping of the handle
  std::atomic<ScanoutState> state_{ScanoutState::Free};
};

/// ScanoutPool holds the dumb buffers that the card scans out, each with the state of its use.
using ScanoutPool = std::vector<std::unique_ptr<KmsBuffer>>;

struct ActiveOutput {
  std::unique_ptr<KmsOutput> output;
  ScanoutPool buffers;         ///< released before the output
  KmsBuffer* front = nullptr;  ///< the displayed buffer
};

/// Creates up to `count` buffers, as many as there is memory for. Throws Error(Failed) if fewer
/// than two.
[[nodiscard]] inline ScanoutPool make_scanout_pool(int fd,
                                                   const std::shared_ptr<KmsPlatform>& platform,
                                                   const ScanoutLayout& layout, int count) {
  ScanoutPool pool;
  while (static_cast<int>(pool.size()) <
         std::clamp(count, kMinScanoutBuffers, kMaxScanoutBuffers)) {
    try {
      pool.push_back(std::make_unique<KmsBuffer>(fd, platform, layout));
    } catch (const Error&) {
      if (static_cast<int>(pool.size()) < kMinScanoutBuffers) throw;
      break;
    }
  }
  return pool;
}

// --- taking over the output of the previous player ------------------------------------------

/// Returns true if the connector has the panel of the state.
inline bool same_panel(const ConnectorInfo& connector, const TakeoverState& state) {
  if (!connector.connected) return false;
  const std::string_view known(state.edid_sha256.data(), state.edid_sha256.size());
  return connector.edid.identity ? connector.edid.identity->sha256 == known : known[0] == '\0';
}

/// Returns the connectors of the state's panel: the first one and the other tiles, or the wall's
/// other panels, if there are any. Empty if the panel is not there, or does not match the request.
inline std::vector<ConnectorInfo> connectors_of_panel(int fd, const KmsOptions& options) {
  const TakeoverState& state = options.previous->state;
  const auto first = read_connector(fd, state.connector, Probe::Full);
  if (!first || !same_panel(*first, state)) return {};
  ConnectorList list;
  list.connectors.push_back({state.card.data(), *first});
  const bool of_wall = !options.output.parts.empty();
  const auto belongs = [&](const ConnectorInfo& other) {
    return of_wall || (other.tile && first->tile && other.tile->group == first->tile->group);
  };
  if (of_wall || first->tile)
    for (ConnectorInfo& other : read_connectors(fd, Probe::Full))
      if (other.id != first->id && belongs(other))
        list.connectors.push_back({state.card.data(), std::move(other)});
  const OutputChoice choice = choose_output(options.output, list);
  if (choice.tiles.empty() || choice.tiles.front() != 0) return {};
  return choice.connectors_in(list);
}

/// Returns the buffer that the kernel's plane shows; null if none of these.
inline KmsBuffer* displayed_buffer(int fd, const TakeoverState& state, const ScanoutPool& buffers) {
  const DrmPlane plane(drmModeGetPlane(fd, state.plane));
  if (!plane || plane->crtc_id != state.crtc) return nullptr;
  const auto found = std::ranges::find_if(
      buffers, [&](const auto& buffer) { return buffer->framebuffer() == plane->fb_id; });
  return found == buffers.end() ? nullptr : found->get();
}

inline ScanoutLayout layout_for(const KmsOptions& options, ScanoutDepth depth) {
  ScanoutLayout layout{
      .geometry = options.output.panel, .mounting = options.mounting, .depth = depth};
  for (const OutputPart& part : options.output.parts) layout.parts.push_back(part.place);
  return layout;
}

inline ScanoutPool take_over_buffers(int fd, const KmsOptions& options, ScanoutDepth depth) {
  const TakeoverState& state = options.previous->state;
  ScanoutPool pool;
  for (uint32_t i = 0; i < state.buffer_count; ++i)
    pool.push_back(std::make_unique<KmsBuffer>(fd, options.platform, layout_for(options, depth),
                                               state.buffers[i]));
  return pool;
}

/// Discards events that were meant for the previous player.
inline void drain_events(int fd) {
  for (int i = 0; i < 16; ++i) (void)read_drm_events(fd, [](const DrmEvent&) {});
}

/// Returns none, without changing the output, if any part does not match the state.
inline std::optional<ActiveOutput> try_take_over(const KmsOptions& options, DrmDevice& device) {
  const TakeoverState& state = options.previous->state;
  const frames::FrameGeometry panel = options.output.panel;
  if (state.width != panel.width || state.height != panel.height) return std::nullopt;
  if (!device.caps().sufficient() ||
      device.session().ensure_master(device.fd()) != Mastership::Held)
    return std::nullopt;
  const int fd = device.fd();
  const std::vector<ConnectorInfo> connectors = connectors_of_panel(fd, options);
  if (connectors.empty()) return std::nullopt;
  std::vector<Pipe> pipes = choose_pipes(fd, connectors, options.output);
  const Pipe& pipe = pipes.front();
  const ScanoutDepth depth = pipe.depth;
  if (pipe.crtc != state.crtc || pipe.plane != state.plane ||
      state.bits != static_cast<uint32_t>(bits_of(depth)))
    return std::nullopt;

  drain_events(fd);
  ActiveOutput active;
  ScanoutPool buffers = take_over_buffers(fd, options, depth);
  active.front = displayed_buffer(fd, state, buffers);
  active.output =
      std::make_unique<KmsOutput>(std::move(device), std::move(pipes), options.platform);
  active.buffers = std::move(buffers);
  if (active.front == nullptr) active.front = active.buffers.front().get();
  active.output->activate(active.front->framebuffer(), *options.clock, RunningMode::TakeOver);
  return active;
}

/// Takes over `options.previous`; returns none if it does not match, and then its buffers are freed
/// and its card is in `card`.
inline std::optional<ActiveOutput> take_over_output(const KmsOptions& options,
                                                    std::optional<DrmDevice>& card) {
  PreviousOutput& previous = *options.previous;
  try {
    card.emplace(DrmDevice::adopt(options.session, std::move(previous.card),
                                  std::string(previous.state.card.data())));
    if (!options.fresh)
      if (auto active = try_take_over(options, *card)) return active;
  } catch (const Error&) {
    // The state does not match: start from scratch.
  }
  if (card && card->fd() >= 0) discard_buffers(card->fd(), previous.state);
  return std::nullopt;
}

// --- opening any output ---------------------------------------------------------------------

/// Finds the requested panel's connectors and its card.
inline std::pair<DrmDevice, std::vector<ConnectorInfo>> find_panel(
    const KmsOptions& options, std::optional<DrmDevice>& previous) {
  ConnectorList list = list_connectors(options.session, previous);
  const OutputChoice choice = choose_output(options.output, list);
  if (choice.tiles.empty()) throw Error(choice.refusal);
  const size_t device = *list.connectors[choice.tiles.front()].device;
  return {std::move(list.devices[device]), choice.connectors_in(list)};
}

inline void require_master(const DrmDevice& device) {
  switch (device.session().ensure_master(device.fd())) {
    case Mastership::Held:
      return;
    case Mastership::Denied:
      throw device_error("{}: cannot become DRM master: permission denied", device.path())
          .remedy(
              "another program opened it first: stop the desktop session, plymouth or the "
              "other player ('fuser -v' on the card names it)");
    case Mastership::Busy:
      throw device_error("{}: cannot become DRM master: in use", device.path())
          .remedy(
              "stop the desktop session, plymouth or the other player ('fuser -v' on the card "
              "names it)");
  }
}

inline void require_caps(const DrmDevice& device) {
  const DrmCaps& caps = device.caps();
  if (caps.sufficient()) return;
  const char* const missing = !caps.atomic                 ? "atomic modesetting"
                              : !caps.dumb_buffers         ? "dumb buffers"
                              : !caps.monotonic_timestamps ? "monotonic timestamps"
                                                           : "the CRTC in its events";
  throw device_error("{}: driver {} lacks {}", device.path(), device.driver(), missing)
      .remedy("use a card with a kernel modesetting driver (nvidia: nvidia_drm.modeset=1)");
}

/// Throws Error(Quality) if the output is known to change subpixels and that is not allowed.
inline void require_exact(const KmsOptions& options, const KmsOutput& output) {
  const ExactnessReport report = output.report();
  if (options.allow_inexact || report.verdict != Verdict::No) return;
  std::string why;
  for (const std::string& reason : report.reasons) why += (why.empty() ? "" : "; ") + reason;
  std::string hint;
  for (const std::string& remedy : report.remedies) hint += remedy + ", or ";
  throw quality_error("{} on {}: subpixels would not arrive unchanged: {}", output.name(),
                      output.device().path(), why)
      .remedy(hint + "use --allow-inexact to show frames anyway");
}

inline ActiveOutput open_new_output(const KmsOptions& options, std::optional<DrmDevice> previous) {
  auto [device, connectors] = find_panel(options, previous);
  require_caps(device);
  require_master(device);
  std::vector<Pipe> pipes = choose_pipes(device.fd(), connectors, options.output);
  const ScanoutDepth depth = pipes.front().depth;

  ActiveOutput active;
  active.output =
      std::make_unique<KmsOutput>(std::move(device), std::move(pipes), options.platform);
  active.output->foresee();
  // Checked before a frame is shown, as far as the facts are known.
  require_exact(options, *active.output);
  active.buffers = make_scanout_pool(active.output->device().fd(), options.platform,
                                     layout_for(options, depth), options.buffers);
  active.front = active.buffers.front().get();
  active.output->activate(active.front->framebuffer(), *options.clock,
                          options.fresh ? RunningMode::SetAnew : RunningMode::TakeOver);
  return active;
}

template <size_t N>
void copy_text(const std::string& text, std::array<char, N>& to) noexcept {
  std::memcpy(to.data(), text.data(), std::min(text.size(), N));
}

/// Opens the requested output. All services in `options` must be set. Takes over
/// `options.previous`; if any part of its state does not match, frees its buffers and finds
/// connector, mode and CRTC itself. Throws as open_kms_display().
[[nodiscard]] inline ActiveOutput open_output(const KmsOptions& options) {
  std::optional<DrmDevice> card;
  if (options.previous && options.previous->card)
    if (auto active = take_over_output(options, card)) return std::move(*active);
  return open_new_output(options, std::move(card));
}

/// Describes the output for the next player.
[[nodiscard]] inline TakeoverState takeover_state_of(const ActiveOutput& active,
                                                     frames::FrameGeometry geometry) {
  TakeoverState state;
  const Pipe& pipe = active.output->pipe();
  state.connector = pipe.connector.id;
  state.crtc = pipe.crtc;
  state.plane = pipe.plane;
  state.width = geometry.width;
  state.height = geometry.height;
  state.bits = static_cast<uint32_t>(bits_of(pipe.depth));
  state.buffer_count = static_cast<uint32_t>(active.buffers.size());
  for (size_t i = 0; i < active.buffers.size(); ++i)
    state.buffers.at(i) = active.buffers[i]->takeover_buffer();
  if (pipe.connector.edid.identity)
    copy_text(pipe.connector.edid.identity->sha256, state.edid_sha256);
  copy_text(active.output->device().path(), state.card);
  state.card.back() = '\0';
  return state;
}

}  // namespace lenticule::display
