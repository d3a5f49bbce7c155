// SPDX-License-Identifier: Apache-2.0
// Implements lenticule.h over RingRenderer: checks the arguments of C callers, and lets no
// exception through.
#include <chrono>
#include <cstddef>
#include <exception>
#include <memory>

#include "base/error.h"
#include "frames/ring/ring_renderer.h"
#include "include/lenticule.h"

using lenticule::frames::RendererHello;
using lenticule::frames::RingContent;
using lenticule::frames::RingRenderer;
using lenticule::frames::RingStatus;

struct lenticule_ring {
  std::unique_ptr<RingRenderer> renderer;
  bool holds_slot = false;
  bool has_published = false;
  bool finished = false;
  uint64_t last_number = 0;
};

namespace {

// A longer text is cut: reporting must not fail, so it must not allocate.
constexpr size_t kMaxErrorBytes = 1024;
thread_local char last_error[kMaxErrorBytes] = "";

lenticule_status report(lenticule_status status, const char* what, const char* hint = "") noexcept {
  size_t used = 0;
  for (const char* text : {what, *hint ? "\n" : "", hint})
    while (*text && used + 1 < kMaxErrorBytes) last_error[used++] = *text++;
  last_error[used] = '\0';
  return status;
}

lenticule_status status_of(const lenticule::Error& error) noexcept {
  constexpr lenticule_status kStatuses[] = {// from Failed to Quality
                                            LENTICULE_FAILED, LENTICULE_MISUSE, LENTICULE_NO_PLAYER,
                                            LENTICULE_REFUSED, LENTICULE_REFUSED};
  return kStatuses[static_cast<size_t>(error.kind()) - 1];
}

lenticule_status status_of(RingStatus status) noexcept {
  switch (status) {
    case RingStatus::Ok:
      return LENTICULE_OK;
    case RingStatus::TimedOut:
      return report(LENTICULE_TIMED_OUT, "ring: no slot became free in time");
    case RingStatus::Gone:
      return report(LENTICULE_GONE, "ring: the player has ended",
                    "close the ring and connect again");
  }
  return LENTICULE_FAILED;
}

/// Runs `body`; converts every exception to a status and a text.
template <typename Body>
lenticule_status guarded(Body body) noexcept {
  try {
    return body();
  } catch (const lenticule::Error& error) {
    return report(status_of(error), error.what(), error.hint().c_str());
  } catch (const std::exception& error) {
    return report(LENTICULE_FAILED, error.what());
  } catch (...) {
    return report(LENTICULE_FAILED, "ring: unknown failure");
  }
}

lenticule_status misuse(const char* what) noexcept { return report(LENTICULE_MISUSE, what); }

RendererHello hello_of(const lenticule_hello* said) {
  RendererHello hello;
  hello.name = "unnamed";
  if (!said) return hello;
  if (said->name) hello.name = said->name;
  if (said->rig_fingerprint) hello.rig_fingerprint = said->rig_fingerprint;
  if (said->rate_numerator != 0 || said->rate_denominator != 0)
    hello.rate = lenticule::frames::Rate{said->rate_numerator, said->rate_denominator};
  hello.views = said->struct_size >= sizeof(lenticule_hello) && said->pushes_views != 0;
  if (said->frame_count >= 0) hello.frame_count = static_cast<uint64_t>(said->frame_count);
  return hello;
}

bool is_open(const lenticule_ring* ring) noexcept { return ring && ring->renderer; }

}  // namespace

lenticule_status lenticule_ring_connect(const char* socket, const lenticule_hello* hello,
                                        int timeout_ms, lenticule_ring** out) {
  if (!out) return misuse("lenticule_ring_connect: out is NULL");
  *out = nullptr;
  if (!socket) return misuse("lenticule_ring_connect: socket is NULL");
  if (hello && hello->struct_size < offsetof(lenticule_hello, pushes_views))
    return misuse("lenticule_ring_connect: initialise hello with LENTICULE_HELLO_INIT");
  return guarded([&] {
    auto ring = std::make_unique<lenticule_ring>();
    ring->renderer =
        RingRenderer::connect(socket, hello_of(hello), std::chrono::milliseconds(timeout_ms));
    *out = ring.release();
    return LENTICULE_OK;
  });
}

int lenticule_ring_width(const lenticule_ring* ring) {
  return is_open(ring) ? ring->renderer->geometry().width : 0;
}

int lenticule_ring_height(const lenticule_ring* ring) {
  return is_open(ring) ? ring->renderer->geometry().height : 0;
}

lenticule_pixel_format lenticule_ring_format(const lenticule_ring*) { return LENTICULE_RGB8; }

size_t lenticule_ring_stride(const lenticule_ring* ring) {
  return is_open(ring) ? ring->renderer->geometry().row_bytes() : 0;
}

size_t lenticule_ring_frame_bytes(const lenticule_ring* ring) {
  return is_open(ring) ? ring->renderer->geometry().frame_bytes() : 0;
}

int lenticule_ring_slots(const lenticule_ring* ring) {
  return is_open(ring) ? ring->renderer->slots() : 0;
}

int lenticule_ring_views(const lenticule_ring* ring) {
  return is_open(ring) ? places_in(ring->renderer->content()) : 0;
}

int lenticule_ring_has_depth(const lenticule_ring* ring) {
  return is_open(ring) && ring->renderer->content().kind == RingContent::Colours ? 1 : 0;
}

double lenticule_ring_view_aspect(const lenticule_ring* ring) {
  return is_open(ring) ? ring->renderer->content().aspect : 0.0;
}

lenticule_status lenticule_ring_view(const lenticule_ring* ring, int view, lenticule_rect* out) {
  if (!out || view < 0 || view >= lenticule_ring_views(ring))
    return misuse("lenticule_ring_view: out is NULL, or there is no such view");
  const auto place = place_of_view(ring->renderer->geometry(), ring->renderer->content(), view);
  *out = {place.left, place.top, place.width, place.height};
  return LENTICULE_OK;
}

lenticule_status lenticule_ring_acquire(lenticule_ring* ring, uint64_t number, int timeout_ms,
                                        uint8_t** pixels) {
  if (!pixels) return misuse("lenticule_ring_acquire: pixels is NULL");
  *pixels = nullptr;
  if (!is_open(ring)) return misuse("lenticule_ring_acquire: ring is NULL or not connected");
  if (ring->finished) return report(LENTICULE_GONE, "ring: the sequence was finished");
  if (ring->holds_slot) return misuse("lenticule_ring_acquire: the last slot is not published yet");
  if (ring->has_published && number <= ring->last_number)
    return misuse("lenticule_ring_acquire: frame numbers must increase");
  return guarded([&] {
    std::span<uint8_t> slot;
    const RingStatus status =
        ring->renderer->acquire(number, std::chrono::milliseconds(timeout_ms), slot);
    if (status != RingStatus::Ok) return status_of(status);
    ring->holds_slot = true;
    ring->last_number = number;
    *pixels = slot.data();
    return LENTICULE_OK;
  });
}

lenticule_status lenticule_ring_publish(lenticule_ring* ring) {
  if (!is_open(ring) || !ring->holds_slot)
    return misuse("lenticule_ring_publish: no slot was acquired");
  ring->holds_slot = false;
  ring->has_published = true;
  return guarded([&] { return status_of(ring->renderer->publish()); });
}

lenticule_status lenticule_ring_abandon(lenticule_ring* ring) {
  if (!is_open(ring) || !ring->holds_slot)
    return misuse("lenticule_ring_abandon: no slot was acquired");
  ring->holds_slot = false;
  ring->renderer->abandon();
  return LENTICULE_OK;
}

lenticule_status lenticule_ring_finish(lenticule_ring* ring) {
  if (!is_open(ring) || ring->finished)
    return misuse("lenticule_ring_finish: ring is NULL, not connected or already finished");
  ring->finished = true;
  ring->holds_slot = false;
  return guarded([&] {
    ring->renderer->finish();
    return LENTICULE_OK;
  });
}

void lenticule_ring_close(lenticule_ring* ring) { delete ring; }

const char* lenticule_last_error(void) { return last_error; }

const char* lenticule_version(void) { return LENTICULE_VERSION; }
