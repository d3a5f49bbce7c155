// SPDX-License-Identifier: Apache-2.0
// SeatSession is a session managed by libseat, which takes the card away and returns it when the
// user switches virtual terminals.

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "display/kms/device/platform.h"

// The header of libseat 0.7 does not declare its functions extern "C".
extern "C" {
#include <libseat.h>
}

namespace lenticule::display {
namespace {

constexpr int kEnableTimeoutMs = 2000;

class SeatSession final : public Session {
 public:
  SeatSession() {
    static const libseat_seat_listener listener = {.enable_seat = on_enable,
                                                   .disable_seat = on_disable};
    seat_ = libseat_open_seat(&listener, this);
    if (seat_ == nullptr)
      throw device_error("seat: {}", std::strerror(errno))
          .remedy("start seatd, or log in on a virtual terminal");
    wait_until_enabled();
  }
  ~SeatSession() override {
    for (const auto& [fd, device] : devices_) libseat_close_device(seat_, device);
    libseat_close_seat(seat_);
  }
  SeatSession(const SeatSession&) = delete;
  SeatSession& operator=(const SeatSession&) = delete;

  // libseat keeps its own descriptor per device; this function returns a copy, which the caller may
  // close.
  [[nodiscard]] UniqueFd open_device(const std::string& path) override {
    int opened = -1;
    const int device = libseat_open_device(seat_, path.c_str(), &opened);
    if (device < 0)
      throw device_error("{}: seat: {}", path, std::strerror(errno))
          .remedy("the session must be the active one of its seat");
    UniqueFd fd(opened);
    devices_.emplace_back(fd.get(), device);
    return fd;
  }

  void close_device(int fd) noexcept override {
    const auto found = std::find_if(devices_.begin(), devices_.end(),
                                    [fd](const auto& entry) { return entry.first == fd; });
    if (found == devices_.end()) return;
    libseat_close_device(seat_, found->second);
    devices_.erase(found);
  }

  // The seat manager sets and drops DRM master for its sessions.
  [[nodiscard]] Mastership ensure_master(int /*fd*/) noexcept override {
    return dispatch() ? Mastership::Held : Mastership::Denied;
  }
  void drop_master(int fd) noexcept override { (void)fd; }

  [[nodiscard]] int fd() const noexcept override { return libseat_get_fd(seat_); }
  [[nodiscard]] bool dispatch() noexcept override {
    if (libseat_dispatch(seat_, 0) < 0) enabled_ = false;
    return enabled_;
  }

 private:
  static void on_enable(libseat* /*seat*/, void* self) noexcept {
    static_cast<SeatSession*>(self)->enabled_ = true;
  }
  // Called from dispatch(), on the thread that commits, so no commit can be in progress.
  static void on_disable(libseat* seat, void* self) noexcept {
    static_cast<SeatSession*>(self)->enabled_ = false;
    libseat_disable_seat(seat);
  }

  void wait_until_enabled() {
    for (int waited = 0; !enabled_ && waited < kEnableTimeoutMs; waited += 100)
      if (libseat_dispatch(seat_, 100) < 0) break;
    if (enabled_) return;
    libseat_close_seat(seat_);
    throw Error(ErrorKind::Device, "seat: not the active session", "switch to its terminal");
  }

  libseat* seat_ = nullptr;
  bool enabled_ = false;
  std::vector<std::pair<int, int>> devices_;  ///< descriptor, libseat's device
};

}  // namespace

std::shared_ptr<Session> make_seat_session() {
  return std::make_shared<SeatSession>();
}

}  // namespace lenticule::display
