// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-video/confinement.h"

#include <fcntl.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/lenticule-video/landlock_rules.h"
#include "apps/lenticule-video/seccomp_filter.h"
#include "base/error.h"
#include "base/unique_fd.h"

namespace lenticule::video {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || \
    __has_feature(memory_sanitizer)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif
#else
constexpr bool kSanitized = false;
#endif

constexpr uint64_t kMostPrinted = 1 << 20;

[[noreturn]] void cannot(const char* what) {
  throw Error(
      ErrorKind::Failed,
      std::string("decoder: cannot confine the process: ") + what + ": " + std::strerror(errno),
      "use a kernel with seccomp filters; without them files are not decoded");
}

/// Returns the current size of the address space, with shared libraries and the ring.
uint64_t address_space_bytes() {
  unsigned long pages = 0;
  if (std::FILE* const file = std::fopen("/proc/self/statm", "re")) {
    if (std::fscanf(file, "%lu", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return uint64_t{pages} * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

void limit(decltype(RLIMIT_AS) resource, uint64_t most) {
  const rlimit both{most, most};
  if (setrlimit(resource, &both) != 0) cannot("setrlimit");
}

/// Returns the limit for file sizes. No file may grow, except one to which the output was
/// redirected.
uint64_t largest_file() {
  uint64_t most = 0;
  for (const int fd : {STDOUT_FILENO, STDERR_FILENO}) {
    struct stat status {};
    if (fstat(fd, &status) != 0 || !S_ISREG(status.st_mode)) continue;
    most = std::max(most, static_cast<uint64_t>(status.st_size) + kMostPrinted);
  }
  return most;
}

void set_limits(uint64_t extra_bytes, unsigned descriptors) {
  limit(RLIMIT_AS, address_space_bytes() + extra_bytes);
  // Not 0, because poll() accepts no more entries than this limit.
  limit(RLIMIT_NOFILE, descriptors);
  limit(RLIMIT_FSIZE, largest_file());
  limit(RLIMIT_CORE, 0);
}

/// Leaves the namespaces, if permitted. A service manager or container may forbid it; the filter is
/// sufficient without it.
void leave_namespaces() {
  if (unshare(CLONE_NEWUSER | CLONE_NEWNET | CLONE_NEWIPC) != 0)
    (void)unshare(CLONE_NEWNET | CLONE_NEWIPC);
}

void install(std::vector<sock_filter> code) {
  sock_fprog program{.len = static_cast<unsigned short>(code.size()), .filter = code.data()};
  // Uses prctl instead of seccomp(2), which systemd services may not call by default.
  if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) != 0) cannot("seccomp");
}

void ignore_signals() {
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
}

/// Gives up everything that does not need the filter.
void give_up_rights(uint64_t extra_bytes, pid_t parent, unsigned descriptors) {
  leave_namespaces();
  if (parent > 0 && !die_with(parent))
    throw Error(ErrorKind::Failed, "decoder: the player has ended");
  set_limits(extra_bytes, descriptors);
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) cannot("no_new_privs");
}

/// The rules for files that Landlock enforces, or the reason why it cannot.
struct DeviceRules {
  std::optional<LandlockRules> rules;
  std::string obstacle;
};

DeviceRules no_rules() {
  return {
      .rules = std::nullopt,
      .obstacle = std::string("the kernel's Landlock cannot confine it: ") + std::strerror(errno)};
}

DeviceRules make_device_rules(const std::vector<std::string>& nodes) {
  DeviceRules made{.rules = LandlockRules::create(), .obstacle = {}};
  if (!made.rules || !made.rules->allow_listing("/dev")) return no_rules();
  for (const std::string& node : nodes)
    if (!made.rules->allow_device(node)) return no_rules();
  return made;
}

/// Returns the limit that leaves descriptors for /dev, a device, and the device once more.
unsigned limit_for_devices() {
  constexpr int kDescriptors = 3;
  std::array<UniqueFd, kDescriptors> lowest;
  for (UniqueFd& one : lowest) {
    one = UniqueFd(::open("/", O_PATH | O_CLOEXEC));
    if (!one) cannot("no descriptor is left");
  }
  return static_cast<unsigned>(lowest.back().get()) + 1;
}

}  // namespace

bool die_with(pid_t parent) noexcept {
  (void)prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0);
  return getppid() == parent;
}

void volunteer_for_oom() noexcept {
  const UniqueFd score(open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC));
  constexpr std::array kScore = {'5', '0', '0'};
  (void)!write(score.get(), kScore.data(), kScore.size());
}

void confine(uint64_t extra_bytes, pid_t parent, unsigned descriptors) {
  ignore_signals();
  if (kSanitized) return;
  std::vector<sock_filter> filter = decoder_filter();  // while it may still open a descriptor
  give_up_rights(extra_bytes, parent, descriptors);
  install(std::move(filter));
}

std::string confine_with_devices(uint64_t extra_bytes, pid_t parent,
                                 const std::vector<std::string>& nodes) {
  ignore_signals();
  if (kSanitized) return {};
  std::vector<sock_filter> narrow = decoder_filter();
  std::vector<sock_filter> wide = decoder_filter(Devices::Video);
  DeviceRules device_rules = make_device_rules(nodes);
  const unsigned descriptors = device_rules.rules ? limit_for_devices() : 1;
  give_up_rights(extra_bytes, parent, descriptors);
  if (device_rules.rules && !device_rules.rules->enforce()) device_rules = no_rules();
  install(device_rules.rules ? std::move(wide) : std::move(narrow));
  return device_rules.obstacle;
}

}  // namespace lenticule::video
