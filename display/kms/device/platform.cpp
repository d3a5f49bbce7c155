// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/platform.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <ctime>

#include "base/unique_fd.h"

namespace lenticule::display {
namespace {

constexpr int64_t kNanosecondsPerSecond = 1'000'000'000;
constexpr size_t kMostKernelText = 65536;

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

  // CLOCK_BOOTTIME advances while the machine is suspended, CLOCK_MONOTONIC does not.
  [[nodiscard]] Nanoseconds time_asleep() const noexcept override {
    return read_clock(CLOCK_BOOTTIME) - read_clock(CLOCK_MONOTONIC);
  }
  [[nodiscard]] std::unique_ptr<HotplugMonitor> watch_hotplug() override {
    return make_udev_monitor();
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

std::shared_ptr<KmsPlatform> make_linux_platform() {
  return std::make_shared<LinuxPlatform>();
}

}  // namespace lenticule::display
