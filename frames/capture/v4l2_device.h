// SPDX-License-Identifier: Apache-2.0
// V4l2Device and V4l2System wrap the system calls for cameras: nodes, ioctls, memory, waiting and
// time. Tests replace them.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <grp.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/numbers.h"
#include "base/unique_fd.h"

namespace lenticule::frames::capture {

/// Nanoseconds of CLOCK_MONOTONIC, or of a simulated clock.
using Nanoseconds = std::chrono::nanoseconds;

/// V4l2Device is an open video node; the destructor closes it. Only poll() waits for the camera.
///
/// Thread safety: one thread.
class V4l2Device {
 public:
  virtual ~V4l2Device() = default;

  /// Does one ioctl. Returns 0 or the errno (EINTR included: see v4l2_call).
  [[nodiscard]] virtual int control(unsigned long request, void* argument) noexcept = 0;
  /// Waits for a picture or an event of the driver, at most `timeout`. Returns the events of
  /// poll(2), 0 when there are none or a signal arrived, -errno on failure.
  [[nodiscard]] virtual int poll(Nanoseconds timeout) noexcept = 0;
  /// Maps shared, readable memory; returns null on failure.
  [[nodiscard]] virtual void* map(size_t size, uint32_t offset) noexcept = 0;
  virtual void unmap(void* memory, size_t size) noexcept = 0;
  /// Returns the time of CLOCK_MONOTONIC, the clock of the camera's own timestamps.
  [[nodiscard]] virtual Nanoseconds now() const noexcept = 0;
};

/// V4l2Node is a video node with its stable name under /dev/v4l, which is empty if there is none.
struct V4l2Node {
  std::string path;         ///< "/dev/video0"
  std::string stable_path;  ///< "/dev/v4l/by-id/usb-Maker_Camera_1234-video-index0"
};

struct OpenedDevice {
  std::unique_ptr<V4l2Device> device;  ///< null if the node could not be opened
  int error = 0;                       ///< errno of the failure
};

class V4l2System {
 public:
  virtual ~V4l2System() = default;
  /// Returns all video nodes, ordered by number. Opens none of them.
  [[nodiscard]] virtual std::vector<V4l2Node> nodes() = 0;
  /// Opens a node. Never waits for the device.
  [[nodiscard]] virtual OpenedDevice open(const std::string& path) = 0;
  /// Returns the programs that have the node open, as far as this user can see them: "guvcview
  /// (4711)". Empty if none.
  [[nodiscard]] virtual std::string holders(const std::string& path) = 0;
  /// Returns the group whose members may use the node: "video". Empty if unknown.
  [[nodiscard]] virtual std::string group(const std::string& path) = 0;
};

// Translates failed camera calls to messages with a remedy.

namespace fs = std::filesystem;

inline constexpr int kMostInterruptions = 100;
inline constexpr Nanoseconds kLongestPoll = std::chrono::hours{1};

class LinuxDevice final : public V4l2Device {
 public:
  explicit LinuxDevice(UniqueFd fd) : fd_(std::move(fd)) {}

  [[nodiscard]] int control(unsigned long request, void* argument) noexcept override {
    return ::ioctl(fd_.get(), request, argument) < 0 ? errno : 0;
  }

  [[nodiscard]] int poll(Nanoseconds timeout) noexcept override {
    const int64_t ns = std::clamp(timeout, Nanoseconds{0}, kLongestPoll).count();
    const timespec limit{.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000};
    pollfd waiting{.fd = fd_.get(), .events = POLLIN | POLLPRI, .revents = 0};
    const int count = ::ppoll(&waiting, 1, &limit, nullptr);
    if (count < 0) return errno == EINTR ? 0 : -errno;
    return waiting.revents;
  }

  [[nodiscard]] void* map(size_t size, uint32_t offset) noexcept override {
    void* const memory = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, fd_.get(), offset);
    return memory == MAP_FAILED ? nullptr : memory;
  }

  void unmap(void* memory, size_t size) noexcept override { ::munmap(memory, size); }

  [[nodiscard]] Nanoseconds now() const noexcept override {
    return std::chrono::steady_clock::now().time_since_epoch();
  }

 private:
  UniqueFd fd_;
};

/// Returns 12 for "video12", a negative number for other names.
inline int node_number(std::string_view name) {
  constexpr std::string_view kPrefix = "video";
  if (!name.starts_with(kPrefix)) return -1;
  return number_from<int>(name.substr(kPrefix.size())).value_or(-1);
}

/// Returns the nodes of this machine, by their numbers.
inline std::vector<fs::path> video_nodes() {
  std::vector<fs::path> nodes = entries_of("/dev");
  std::erase_if(nodes, [](const auto& node) { return node_number(node.filename().native()) < 0; });
  return nodes;
}

/// Returns the link to a node: the one by identity if there is one, otherwise the one by path.
inline std::string stable_path_of(const fs::path& node) {
  for (const char* const folder : {"/dev/v4l/by-id", "/dev/v4l/by-path"})
    for (const fs::path& link : entries_of(folder)) {
      std::error_code error;
      if (fs::canonical(link, error) == node) return link.string();
    }
  return {};
}

inline bool has_open(const fs::path& process, const fs::path& node) {
  for (const fs::path& descriptor : entries_of(process / "fd")) {
    std::error_code error;
    if (fs::read_symlink(descriptor, error) == node) return true;
  }
  return false;
}

inline std::string name_of(const fs::path& process) {
  std::string name;
  std::ifstream comm(process / "comm");
  std::getline(comm, name);
  return fmt::format("{} ({})", name, process.filename().string());
}

class LinuxSystem final : public V4l2System {
 public:
  [[nodiscard]] std::vector<V4l2Node> nodes() override {
    std::vector<V4l2Node> nodes;
    for (const fs::path& path : video_nodes())
      nodes.push_back({.path = path.string(), .stable_path = stable_path_of(path)});
    return nodes;
  }

  [[nodiscard]] OpenedDevice open(const std::string& path) override {
    // Only devices are opened: another kind of file could block, or be changed by the open.
    struct stat status {};
    if (::stat(path.c_str(), &status) != 0) return {.device = nullptr, .error = errno};
    if (!S_ISCHR(status.st_mode)) return {.device = nullptr, .error = ENOTTY};
    UniqueFd fd(::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
    if (!fd) return {.device = nullptr, .error = errno};
    return {.device = std::make_unique<LinuxDevice>(std::move(fd)), .error = 0};
  }

  [[nodiscard]] std::string holders(const std::string& path) override {
    std::error_code error;
    const fs::path node = fs::canonical(path, error);
    std::string names;
    for (const fs::path& process : entries_of("/proc")) {
      const std::string id = process.filename().string();
      if (!std::ranges::all_of(id, [](unsigned char c) { return std::isdigit(c) != 0; })) continue;
      if (id == std::to_string(::getpid()) || !has_open(process, node)) continue;
      names += (names.empty() ? "" : ", ") + name_of(process);
    }
    return names;
  }

  [[nodiscard]] std::string group(const std::string& path) override {
    struct stat status {};
    if (::stat(path.c_str(), &status) != 0) return {};
    struct group entry {};
    struct group* found = nullptr;
    std::array<char, 4096> text{};
    ::getgrgid_r(status.st_gid, &entry, text.data(), text.size(), &found);
    return found != nullptr ? found->gr_name : "";
  }
};

/// Returns the kernel's system, shared by all callers.
///
/// Thread safety: any thread.
[[nodiscard]] inline V4l2System& linux_v4l2() {
  static LinuxSystem system;
  return system;
}

/// Does an ioctl and repeats it when a signal interrupts it, a limited number of times. Returns 0
/// or errno.
[[nodiscard]] inline int v4l2_call(V4l2Device& device, unsigned long request,
                                   void* argument) noexcept {
  int error = EINTR;
  for (int i = 0; i < kMostInterruptions && error == EINTR; ++i)
    error = device.control(request, argument);
  return error;
}

inline std::string busy_hint(V4l2System& system, const std::string& path) {
  const std::string holders = system.holders(path);
  if (holders.empty())
    return fmt::format("close the program that uses the camera: 'sudo fuser -v {}' names it", path);
  return "close the program that uses the camera: " + holders;
}

inline std::string forbidden_hint(V4l2System& system, const std::string& path) {
  const std::string group = system.group(path);
  if (group.empty() || group == "root")
    return fmt::format("only root may use {}: install the udev rules, or run as root", path);
  return fmt::format("join its group: 'sudo usermod -aG {} $USER', then log in again", group);
}

inline std::string hint_for(V4l2System& system, const std::string& path, int error) {
  switch (error) {
    case EBUSY:
      return busy_hint(system, path);
    case EACCES:
    case EPERM:
      return forbidden_hint(system, path);
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return "connect the camera; 'lenticule calibrate camera --list' lists the cameras";
    case ENOTTY:
      return "name a camera; 'lenticule calibrate camera --list' lists the cameras";
    case ENOMEM:
    case ENOSPC:
      return "use a smaller picture, fewer frames per second, or a separate USB port";
    default:
      return "disconnect the camera, connect it again, and read the kernel's messages (dmesg)";
  }
}

/// Returns the system's text for an errno in lower case, as in a sentence: "no such device".
///
/// Thread safety: any thread.
[[nodiscard]] inline std::string error_text(int error) {
  std::string text = std::generic_category().message(error);
  if (text.size() > 1 && std::islower(static_cast<unsigned char>(text[1])) != 0)
    text[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(text[0])));
  return text;
}

inline std::string cause_of(int error) {
  switch (error) {
    case EBUSY:
      return "in use by another program";
    case ENOTTY:
      return "not a video device";
    case ENOSPC:
      return "not enough bandwidth on the USB bus";
    default:
      return error_text(error);
  }
}

/// Returns an Error(Device) for `path` that could not be opened, or refused `doing` during setup
/// ("set the format"). Names the programs that have the camera open, and the missing group.
[[nodiscard]] inline Error camera_failure(V4l2System& system, const std::string& path,
                                          const std::string& doing, int error) {
  return {ErrorKind::Device, fmt::format("{}: cannot {}: {}", path, doing, cause_of(error)),
          hint_for(system, path, error)};
}

}  // namespace lenticule::frames::capture
