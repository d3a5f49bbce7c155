// SPDX-License-Identifier: Apache-2.0
// Runs in the guest: pushes numbered frames into a player's ring, as fast as a test allows.
//   vm_paced_renderer SOCKET RIG_FINGERPRINT BASE.ppm COUNT [ALLOWED]
// Frame N is the base picture with N added to every pixel, so that each pixel identifies N and any
// two frames differ everywhere (numbered_frames.py computes the same). The file ALLOWED holds the
// number of frames that may be published; without it all may. A number larger than COUNT finishes
// the sequence. The program ends after two minutes without progress.
#include <lenticule.h>

#include <chrono>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>

#include "ppm.h"

namespace lenticule::vm {
namespace {

constexpr std::chrono::milliseconds kLookAgain{4};
constexpr std::chrono::seconds kTimeout{120};

struct Order {
  std::string socket, fingerprint, base, allowed;
  uint64_t count = 0;
};

class Connection {
 public:
  explicit Connection(const Order& order) {
    lenticule_hello hello = LENTICULE_HELLO_INIT;
    hello.name = "vm_paced_renderer";
    hello.rig_fingerprint = order.fingerprint.c_str();
    hello.frame_count = static_cast<int64_t>(order.count);
    check(lenticule_ring_connect(order.socket.c_str(), &hello, 60'000, &ring_));
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection() { lenticule_ring_close(ring_); }

  [[nodiscard]] size_t bytes() const { return lenticule_ring_frame_bytes(ring_); }

  uint8_t* acquire(uint64_t number) {
    uint8_t* pixels = nullptr;
    const int timeout_ms = static_cast<int>(std::chrono::milliseconds(kTimeout).count());
    check(lenticule_ring_acquire(ring_, number, timeout_ms, &pixels));
    return pixels;
  }
  void publish() { check(lenticule_ring_publish(ring_)); }
  void finish() { check(lenticule_ring_finish(ring_)); }

 private:
  static void check(lenticule_status status) {
    if (status != LENTICULE_OK) throw std::runtime_error(lenticule_last_error());
  }
  lenticule_ring* ring_ = nullptr;
};

void paint(uint8_t* pixels, const Ppm& base, uint64_t number) {
  const auto low = static_cast<uint8_t>(number), high = static_cast<uint8_t>(number >> 8);
  const auto both = static_cast<uint8_t>(low + high);
  const auto* source = base.rgb.data();
  for (size_t at = 0; at < base.rgb.size(); at += 3) {
    pixels[at] = static_cast<uint8_t>(source[at] + low);
    pixels[at + 1] = static_cast<uint8_t>(source[at + 1] + both);
    pixels[at + 2] = static_cast<uint8_t>(source[at + 2] - low);
  }
}

// Returns the number in the file; 0 if the file does not exist.
uint64_t allowed_now(const std::string& path) {
  uint64_t allowed = 0;
  std::ifstream(path) >> allowed;
  return allowed;
}

void wait_until_allowed(const Order& order, uint64_t frames) {
  if (order.allowed.empty()) return;
  const auto give_up = std::chrono::steady_clock::now() + kTimeout;
  while (allowed_now(order.allowed) < frames) {
    if (std::chrono::steady_clock::now() > give_up)
      throw std::runtime_error("frame " + std::to_string(frames) + " was not allowed in time");
    std::this_thread::sleep_for(kLookAgain);
  }
}

void push(const Order& order) {
  const Ppm base = read_ppm(order.base);
  Connection ring(order);
  if (ring.bytes() != base.rgb.size()) throw std::runtime_error(order.base + ": not of this size");
  for (uint64_t number = 0; number < order.count; ++number) {
    wait_until_allowed(order, number + 1);
    paint(ring.acquire(number), base, number);
    ring.publish();
  }
  std::printf("published %llu\n", static_cast<unsigned long long>(order.count));
  std::fflush(stdout);
  wait_until_allowed(order, order.count + 1);
  ring.finish();
}

}  // namespace
}  // namespace lenticule::vm

int main(int argc, char** argv) {
  if (argc < 5 || argc > 6) {
    std::fprintf(stderr, "vm_paced_renderer SOCKET RIG_FINGERPRINT BASE.ppm COUNT [ALLOWED]\n");
    return 2;
  }
  try {
    lenticule::vm::push({.socket = argv[1],
                         .fingerprint = argv[2],
                         .base = argv[3],
                         .allowed = argc > 5 ? argv[5] : "",
                         .count = std::stoull(argv[4])});
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "vm_paced_renderer: %s\n", error.what());
    return 1;
  }
}
