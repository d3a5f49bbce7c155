// SPDX-License-Identifier: Apache-2.0
// Opens files in child processes that Landlock restricts to one device. /dev/null stands for a
// video device. The tests need a kernel with Landlock, as Debian's is.
#include <dirent.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <functional>

#include "apps/lenticule-video/confinement.h"

namespace lenticule::video {
namespace {

constexpr const char* kDevice = "/dev/null";

/// Returns true if a child process under the rules returns true from `body`.
bool holds_under_rules(const std::function<bool()>& body) {
  const pid_t child = fork();
  if (child == 0) {
    std::optional<LandlockRules> rules = LandlockRules::create();
    const bool ready = rules && rules->allow_device(kDevice) && rules->allow_listing("/dev") &&
                       prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && rules->enforce();
    _exit(ready && body() ? 0 : 1);
  }
  int status = -1;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

/// Returns the errno value of opening the file; 0 if it succeeds.
int error_of_opening(const char* path, int flags) {
  const int fd = ::open(path, flags | O_CLOEXEC, S_IRUSR);
  const int error = fd < 0 ? errno : 0;
  if (fd >= 0) ::close(fd);
  return error;
}

TEST(LandlockRules, AllowToOpenTheDeviceAndToControlIt) {
  EXPECT_TRUE(holds_under_rules([] { return error_of_opening(kDevice, O_RDWR) == 0; }));
  EXPECT_TRUE(holds_under_rules([] {
    const int fd = ::open(kDevice, O_RDWR | O_CLOEXEC);
    return ::ioctl(fd, _IO('V', 0)) == -1 && errno == ENOTTY;  // not EACCES
  }));
}

TEST(LandlockRules, RefuseEveryOtherFileAndDevice) {
  for (const char* const path :
       {"/etc/passwd", "/dev/zero", "/dev/tty", "/proc/self/mem", "/bin/sh"})
    EXPECT_TRUE(holds_under_rules([path] { return error_of_opening(path, O_RDONLY) == EACCES; }))
        << path;
  EXPECT_TRUE(holds_under_rules(
      [] { return error_of_opening("/dev/shm/lenticule-new", O_RDWR | O_CREAT) == EACCES; }));
}

TEST(LandlockRules, AllowToListDevicesAndNoOtherFolder) {
  EXPECT_TRUE(holds_under_rules([] { return ::opendir("/dev") != nullptr; }));
  for (const char* const folder : {"/", "/etc", "/tmp", "/proc/self/fd"})
    EXPECT_TRUE(holds_under_rules([folder] {
      return ::opendir(folder) == nullptr && errno == EACCES;
    })) << folder;
}

TEST(LandlockRules, KeepOpenDescriptors) {
  const int fd = ::open("/etc/passwd", O_RDONLY | O_CLOEXEC);
  ASSERT_GE(fd, 0);
  EXPECT_TRUE(holds_under_rules([fd] {
    char byte = 0;
    return ::read(fd, &byte, 1) == 1;
  }));
  ::close(fd);
}

TEST(LandlockRules, AMissingDeviceIsRefused) {
  std::optional<LandlockRules> rules = LandlockRules::create();
  ASSERT_TRUE(rules);
  EXPECT_FALSE(rules->allow_device("/dev/absent-video"));
}

}  // namespace
}  // namespace lenticule::video
