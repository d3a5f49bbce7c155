// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/platform.h"

#include <fcntl.h>
#include <libudev.h>
#include <sys/mman.h>
#include <unistd.h>
#include <xf86drm.h>

#include <cerrno>
#include <cstring>
#include <ctime>

#include "base/error_kinds.h"
#include "base/owned.h"
#include "display/clock.h"

namespace lenticule::display {
namespace {

class DirectSession final : public Session {
 public:
  [[nodiscard]] UniqueFd open_device(const std::string& path) override {
    UniqueFd fd(open(path.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK));
    if (fd) return fd;
    throw device_error("{}: {}", path, std::strerror(errno))
        .remedy(errno == EACCES ? "add the user to the group 'video'" : "");
  }
  void close_device(int fd) noexcept override { (void)fd; }

  [[nodiscard]] Mastership ensure_master(int fd) noexcept override {
    if (drmIsMaster(fd) != 0 || drmSetMaster(fd) == 0) return Mastership::Held;
    return errno == EBUSY ? Mastership::Busy : Mastership::Denied;
  }
  void drop_master(int fd) noexcept override { drmDropMaster(fd); }
};

constexpr size_t kMostKernelText = 65536;

Nanoseconds read_clock(clockid_t id) noexcept {
  timespec time{};
  clock_gettime(id, &time);
  return Nanoseconds(time.tv_sec * kNanosecondsPerSecond + time.tv_nsec);
}

using Udev = Owned<udev, udev_unref>;
using UdevMonitor = Owned<udev_monitor, udev_monitor_unref>;
using UdevDevice = Owned<udev_device, udev_device_unref>;

/// UdevHotplug receives hotplug events from udev. Every "change" of a card counts: events from the
/// kernel, `udevadm trigger` and sysfs differ only in details that are probed afterwards anyway.
class UdevHotplug final : public HotplugMonitor {
 public:
  UdevHotplug() : udev_(udev_new()) {
    if (!udev_) return;
    monitor_.reset(udev_monitor_new_from_netlink(udev_.get(), "udev"));
    if (!monitor_) return;
    if (udev_monitor_filter_add_match_subsystem_devtype(monitor_.get(), "drm", nullptr) < 0 ||
        udev_monitor_enable_receiving(monitor_.get()) < 0)
      monitor_.reset();
  }

  [[nodiscard]] int fd() const noexcept override {
    return monitor_ ? udev_monitor_get_fd(monitor_.get()) : -1;
  }

  [[nodiscard]] bool drain() noexcept override {
    bool any = false;
    while (monitor_) {
      const UdevDevice device(udev_monitor_receive_device(monitor_.get()));
      if (!device) break;
      any = true;
    }
    return any;
  }

 private:
  Udev udev_;
  UdevMonitor monitor_;
};

class LinuxPlatform final : public KmsPlatform {
 public:
  [[nodiscard]] void* map(int fd, uint64_t offset, size_t size) noexcept override {
    void* const memory =
        mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, fd, static_cast<off_t>(offset));
    return memory == MAP_FAILED ? nullptr : memory;
  }
  void unmap(void* memory, size_t size) noexcept override { munmap(memory, size); }

  // CLOCK_BOOTTIME advances while the machine is suspended, CLOCK_MONOTONIC does not.
  [[nodiscard]] Nanoseconds time_asleep() const noexcept override {
    return read_clock(CLOCK_BOOTTIME) - read_clock(CLOCK_MONOTONIC);
  }
  [[nodiscard]] std::unique_ptr<HotplugMonitor> watch_hotplug() override {
    return std::make_unique<UdevHotplug>();
  }
  [[nodiscard]] std::optional<std::string> read_kernel_file(const std::string& path) override {
    const UniqueFd fd(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK));
    if (!fd) return std::nullopt;
    std::string text(kMostKernelText, '\0');
    size_t length = 0;
    while (length < text.size()) {
      const ssize_t got = read(fd.get(), text.data() + length, text.size() - length);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) return std::nullopt;
      if (got == 0) break;
      length += static_cast<size_t>(got);
    }
    text.resize(length);
    return text;
  }
  [[nodiscard]] std::shared_ptr<TerminalCalls> terminal() override { return make_terminal_calls(); }
};

}  // namespace

std::shared_ptr<Session> make_direct_session() { return std::make_shared<DirectSession>(); }

std::shared_ptr<KmsPlatform> make_linux_platform() { return std::make_shared<LinuxPlatform>(); }

}  // namespace lenticule::display
