// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/session.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <xf86drm.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace lenticule::display {
namespace {

class DirectSession final : public Session {
 public:
  [[nodiscard]] UniqueFd open_device(const std::string& path) override {
    UniqueFd fd(open(path.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK));
    if (fd) return fd;
    throw Error(ErrorKind::Device, fmt::format("{}: {}", path, std::strerror(errno)),
                errno == EACCES ? "add the user to the group 'video'" : "");
  }
  void close_device(int fd) noexcept override { (void)fd; }

  [[nodiscard]] Mastership ensure_master(int fd) noexcept override {
    if (drmIsMaster(fd) != 0 || drmSetMaster(fd) == 0) return Mastership::Held;
    return errno == EBUSY ? Mastership::Busy : Mastership::Denied;
  }
  void drop_master(int fd) noexcept override { drmDropMaster(fd); }
};

}  // namespace

std::shared_ptr<Session> make_direct_session() {
  return std::make_shared<DirectSession>();
}

#if !defined(LENTICULE_HAVE_LIBSEAT)
std::shared_ptr<Session> make_seat_session() {
  throw Error(ErrorKind::Device, "seat: this build has no libseat",
              "leave the seat option out and stop the desktop session");
}
#endif

}  // namespace lenticule::display
