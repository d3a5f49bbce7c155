// SPDX-License-Identifier: Apache-2.0
#include "display/kms/platform.h"

#include <sys/mman.h>

#include <ctime>

namespace lenticule::display {
namespace {

constexpr int64_t kNanosecondsPerSecond = 1'000'000'000;

Nanoseconds read_clock(clockid_t id) noexcept {
  timespec time{};
  clock_gettime(id, &time);
  return Nanoseconds(time.tv_sec * kNanosecondsPerSecond + time.tv_nsec);
}

class LinuxPlatform final : public KmsPlatform {
 public:
  [[nodiscard]] void* map(int fd, uint64_t offset, size_t size) noexcept override {
    void* const memory =
        mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, fd, static_cast<off_t>(offset));
    return memory == MAP_FAILED ? nullptr : memory;
  }
  void unmap(void* memory, size_t size) noexcept override { munmap(memory, size); }

  // CLOCK_BOOTTIME goes on while the machine sleeps, CLOCK_MONOTONIC does not.
  [[nodiscard]] Nanoseconds time_asleep() const noexcept override {
    return read_clock(CLOCK_BOOTTIME) - read_clock(CLOCK_MONOTONIC);
  }
  [[nodiscard]] std::unique_ptr<HotplugMonitor> watch_hotplug() override {
    return make_udev_monitor();
  }
  [[nodiscard]] std::shared_ptr<TerminalCalls> terminal() override { return make_terminal_calls(); }
};

}  // namespace

std::shared_ptr<KmsPlatform> make_linux_platform() {
  return std::make_shared<LinuxPlatform>();
}

}  // namespace lenticule::display
