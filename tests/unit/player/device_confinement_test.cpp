// SPDX-License-Identifier: Apache-2.0
// Confines child processes that may open one device, on kernels with and without Landlock.
// /dev/null stands for a video device.
#include <dirent.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <functional>
#include <string>

#include "apps/lenticule-video/confinement.h"

namespace lenticule::video {
namespace {

constexpr const char* kDevice = "/dev/null";
constexpr uint64_t kMemory = uint64_t{1} << 30;

/// Returns true if `body` returns true in a child process.
bool holds_in_child(const std::function<bool()>& body) {
  const pid_t child = fork();
  if (child == 0) _exit(body() ? 0 : 1);
  int status = -1;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

/// Returns true if the process may use the device after confinement, and `body` returns true.
bool holds_with_device(const std::function<bool()>& body) {
  return holds_in_child(
      [&] { return confine_with_devices(kMemory, 0, {kDevice}).empty() && body(); });
}

int error_of_opening(const char* path, int flags = O_RDWR) {
  const int fd = ::open(path, flags | O_CLOEXEC, S_IRUSR);
  return fd < 0 ? errno : 0;
}

/// Makes the kernel appear to have no Landlock.
bool hide_landlock() {
  std::array<sock_filter, 4> code = {{
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<uint32_t>(offsetof(seccomp_data, nr))),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_landlock_create_ruleset, 0, 1),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOSYS),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  }};
  const sock_fprog program{.len = code.size(), .filter = code.data()};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) == 0;
}

TEST(ConfineWithDevices, AllowsTheDeviceAndNoOtherFile) {
  EXPECT_TRUE(holds_with_device([] { return error_of_opening(kDevice) == 0; }));
  for (const int flags : {O_RDWR, O_RDONLY})
    for (const char* const path : {"/dev/zero", "/etc/passwd", "/proc/self/mem"})
      EXPECT_TRUE(holds_with_device([&] { return error_of_opening(path, flags) == EACCES; }))
          << path << " with flags " << flags;
  EXPECT_TRUE(holds_with_device(
      [] { return error_of_opening("/dev/shm/lenticule-new", O_RDWR | O_CREAT) == EACCES; }));
}

TEST(ConfineWithDevices, AllowsToListDevicesAndNoOtherFolder) {
  EXPECT_TRUE(holds_with_device([] { return ::opendir("/dev") != nullptr; }));
  for (const char* const folder : {"/", "/etc", "/tmp", "/proc/self/fd"})
    EXPECT_TRUE(holds_with_device([folder] {
      return ::opendir(folder) == nullptr && errno == EACCES;
    })) << folder;
}

TEST(ConfineWithDevices, AllowsFewDescriptors) {
  EXPECT_TRUE(holds_with_device([] {
    int opened = 0;
    while (error_of_opening(kDevice) == 0) ++opened;
    return errno == EMFILE && opened >= 3 && opened <= 4;
  }));
}

TEST(ConfineWithDevices, RefusesOtherRequestsNetworkAndProcesses) {
  EXPECT_TRUE(holds_with_device([] {
    const int fd = ::open(kDevice, O_RDWR | O_CLOEXEC);
    return ::ioctl(fd, TIOCSTI, "x") == -1 && errno == EPERM;
  }));
  EXPECT_TRUE(
      holds_with_device([] { return ::socket(AF_INET, SOCK_STREAM, 0) == -1 && errno == EPERM; }));
  EXPECT_TRUE(holds_with_device([] { return ::fork() == -1 && errno == EPERM; }));
}

TEST(ConfineWithDevices, ConfinesAsWithoutDevicesWhereTheKernelHasNoLandlock) {
  EXPECT_TRUE(holds_in_child([] {
    if (!hide_landlock()) return false;
    const std::string obstacle = confine_with_devices(kMemory, 0, {kDevice});
    return obstacle.find("Landlock") != std::string::npos && error_of_opening(kDevice) == EPERM;
  }));
}

TEST(ConfineWithDevices, ConfinesAsWithoutDevicesWhenTheDeviceIsGone) {
  EXPECT_TRUE(holds_in_child([] {
    return !confine_with_devices(kMemory, 0, {kDevice, "/dev/absent-video"}).empty() &&
           error_of_opening(kDevice) == EPERM;
  }));
}

}  // namespace
}  // namespace lenticule::video
