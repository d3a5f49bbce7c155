// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/drm_events.h"

#include <drm.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

namespace lenticule::display {
namespace {

constexpr size_t kReadBytes = 4096;

/// Copies the bytes into the kernel's structure; returns false if there are too few.
template <typename Event>
bool load(std::span<const uint8_t> bytes, Event& event) noexcept {
  if (bytes.size() < sizeof(Event)) return false;
  std::memcpy(&event, bytes.data(), sizeof(Event));
  return true;
}

bool handle_flip(std::span<const uint8_t> bytes, DrmEventHandler& handler) noexcept {
  drm_event_vblank event{};
  if (!load(bytes, event)) return false;
  handler.on_drm_event(
      {.kind = DrmEvent::Kind::Flip,
       .id = event.user_data,
       .sequence = event.sequence,
       .time = std::chrono::seconds(event.tv_sec) + std::chrono::microseconds(event.tv_usec),
       .crtc = event.crtc_id});
  return true;
}

bool handle_sequence(std::span<const uint8_t> bytes, DrmEventHandler& handler) noexcept {
  drm_event_crtc_sequence event{};
  if (!load(bytes, event)) return false;
  handler.on_drm_event({.kind = DrmEvent::Kind::Sequence,
                        .id = event.user_data,
                        .sequence = event.sequence,
                        .time = Nanoseconds(event.time_ns)});
  return true;
}

bool readable(int fd) noexcept {
  pollfd entry{.fd = fd, .events = POLLIN, .revents = 0};
  return poll(&entry, 1, 0) == 1;
}

}  // namespace

EventRead parse_drm_events(std::span<const uint8_t> bytes, DrmEventHandler& handler) noexcept {
  while (!bytes.empty()) {
    drm_event header{};
    if (!load(bytes, header) || header.length < sizeof(header) || header.length > bytes.size())
      return EventRead::Truncated;
    const auto event = bytes.first(header.length);
    bool whole = true;
    if (header.type == DRM_EVENT_FLIP_COMPLETE) whole = handle_flip(event, handler);
    if (header.type == DRM_EVENT_CRTC_SEQUENCE) whole = handle_sequence(event, handler);
    if (!whole) return EventRead::Truncated;
    bytes = bytes.subspan(header.length);
  }
  return EventRead::Ok;
}

EventRead read_drm_events(int fd, DrmEventHandler& handler) noexcept {
  // An inherited descriptor may be in blocking mode, so check before reading.
  if (!readable(fd)) return EventRead::Ok;
  std::array<uint8_t, kReadBytes> buffer;
  const ssize_t count = read(fd, buffer.data(), buffer.size());
  if (count > 0) return parse_drm_events({buffer.data(), static_cast<size_t>(count)}, handler);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return EventRead::Ok;
  return EventRead::Gone;
}

}  // namespace lenticule::display
