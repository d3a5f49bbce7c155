// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-video/confinement.h"

#include <fcntl.h>
#include <linux/landlock.h>
#include <linux/sched.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <utility>

#include "base/error_kinds.h"
#include "base/owned.h"

namespace lenticule::video {
namespace {

// Rights that are younger than the headers of Debian 12.
constexpr uint64_t kTruncate = uint64_t{1} << 14;
constexpr uint64_t kControlDevice = uint64_t{1} << 15;

constexpr uint64_t kFirstRights = (LANDLOCK_ACCESS_FS_MAKE_SYM << 1) - 1;
constexpr int kVersionWithRefer = 2;
constexpr int kVersionWithTruncate = 3;
constexpr int kVersionWithControl = 5;

/// Returns all rights on files that this version of the interface knows.
uint64_t rights_of(long version) {
  uint64_t rights = kFirstRights;
  if (version >= kVersionWithRefer) rights |= LANDLOCK_ACCESS_FS_REFER;
  if (version >= kVersionWithTruncate) rights |= kTruncate;
  if (version >= kVersionWithControl) rights |= kControlDevice;
  return rights;
}

/// Calls for open descriptors, memory, threads, time and exit. libseccomp skips those that the
/// architecture does not have.
constexpr std::array kAllowed = {
    SCMP_SYS(read),
    SCMP_SYS(pread64),
    SCMP_SYS(readv),
    SCMP_SYS(write),
    SCMP_SYS(writev),
    SCMP_SYS(lseek),
    SCMP_SYS(close),
    SCMP_SYS(fstat),
    SCMP_SYS(sendmsg),
    SCMP_SYS(recvmsg),
    SCMP_SYS(poll),
    SCMP_SYS(ppoll),
    SCMP_SYS(munmap),
    SCMP_SYS(mremap),
    SCMP_SYS(madvise),
    SCMP_SYS(brk),
    SCMP_SYS(futex),
    SCMP_SYS(rseq),
    SCMP_SYS(rt_sigaction),
    SCMP_SYS(rt_sigprocmask),
    SCMP_SYS(rt_sigreturn),
    SCMP_SYS(sigaltstack),
    SCMP_SYS(set_robust_list),
    SCMP_SYS(sched_yield),
    SCMP_SYS(sched_getaffinity),
    SCMP_SYS(getpid),
    SCMP_SYS(gettid),
    SCMP_SYS(getrandom),
    SCMP_SYS(clock_gettime),
    SCMP_SYS(clock_nanosleep),
    SCMP_SYS(nanosleep),
    SCMP_SYS(gettimeofday),
    SCMP_SYS(restart_syscall),
    SCMP_SYS(exit),
    SCMP_SYS(exit_group),
};

constexpr uint32_t kDenied = SCMP_ACT_ERRNO(EPERM);
/// Interface of Linux 4.14, the first one with SCMP_ACT_KILL_PROCESS. Detecting the interface would
/// call seccomp(2), which systemd services may not call by default.
constexpr unsigned kInterface = 3;

/// Throws for a negative errno value.
void check(int result) {
  if (result < 0)
    throw failed_error("decoder: cannot create the filter of system calls: {}",
                       std::strerror(-result));
}

class Rules {
 public:
  Rules() {
    check(seccomp_api_set(kInterface));
    context_.reset(seccomp_init(kDenied));
    if (!context_) check(-ENOMEM);
    check(seccomp_attr_set(context_.get(), SCMP_FLTATR_ACT_BADARCH, SCMP_ACT_KILL_PROCESS));
  }

  void add(int call, uint32_t action) {
    check(seccomp_rule_add_array(context_.get(), action, call, 0, nullptr));
  }
  /// Allows the call if the bits `mask` of an argument are `value`.
  void allow_if(int call, unsigned argument, uint32_t mask, uint32_t value) {
    const scmp_arg_cmp condition{argument, SCMP_CMP_MASKED_EQ, mask, value};
    check(seccomp_rule_add_array(context_.get(), SCMP_ACT_ALLOW, call, 1, &condition));
  }

  [[nodiscard]] std::vector<sock_filter> program() const {
    const UniqueFd file(memfd_create("lenticule-filter", MFD_CLOEXEC));
    if (!file) check(-errno);
    check(seccomp_export_bpf(context_.get(), file.get()));
    const off_t bytes = lseek(file.get(), 0, SEEK_END);
    std::vector<sock_filter> code(bytes > 0 ? static_cast<size_t>(bytes) / sizeof(sock_filter) : 0);
    if (bytes <= 0 || pread(file.get(), code.data(), static_cast<size_t>(bytes), 0) != bytes)
      check(-EIO);
    return code;
  }

 private:
  Owned<void, seccomp_release> context_;
};

/// Requests of V4L2 have the type 'V' in bits 8 to 15.
constexpr uint32_t kRequestType = 0xff00;
constexpr uint32_t kVideoRequest = uint32_t{'V'} << 8;

/// Allows what opening a device takes: listing /dev, where the C library asks for the type of the
/// open folder, and opening and controlling the device.
void allow_video_devices(Rules& rules) {
  rules.add(SCMP_SYS(openat), SCMP_ACT_ALLOW);
  rules.add(SCMP_SYS(getdents64), SCMP_ACT_ALLOW);
  rules.allow_if(SCMP_SYS(newfstatat), 3, UINT32_MAX, AT_EMPTY_PATH);
  rules.allow_if(SCMP_SYS(ioctl), 1, kRequestType, kVideoRequest);
}

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

void set_limits(uint64_t extra_bytes, unsigned descriptors, uint64_t made_file_bytes) {
  limit(RLIMIT_AS, address_space_bytes() + extra_bytes);
  // Not 0, because poll() accepts no more entries than this limit.
  limit(RLIMIT_NOFILE, descriptors);
  limit(RLIMIT_FSIZE, std::max(largest_file(), made_file_bytes));
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
void give_up_rights(uint64_t extra_bytes, pid_t parent, unsigned descriptors,
                    uint64_t made_file_bytes = 0) {
  leave_namespaces();
  if (parent > 0 && !die_with(parent))
    throw Error(ErrorKind::Failed, "decoder: the player has ended");
  set_limits(extra_bytes, descriptors, made_file_bytes);
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) cannot("no_new_privs");
}

/// Returns the rules that Landlock can enforce for these devices; none, with errno, if it cannot.
std::optional<LandlockRules> make_device_rules(const std::vector<std::string>& nodes) {
  auto rules = LandlockRules::create();
  if (!rules || !rules->allow_listing("/dev")) return std::nullopt;
  for (const std::string& node : nodes)
    if (!rules->allow_device(node)) return std::nullopt;
  return rules;
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

std::optional<LandlockRules> LandlockRules::create() {
  const long version =
      ::syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  if (version < 1) return std::nullopt;
  // Kernels accept this first version of the structure, which has rights on files only.
  const uint64_t handled = rights_of(version);
  const struct { uint64_t handled_access_fs; } attributes{handled};
  UniqueFd rules(
      static_cast<int>(::syscall(SYS_landlock_create_ruleset, &attributes, sizeof attributes, 0)));
  if (!rules) return std::nullopt;
  return LandlockRules(std::move(rules), handled);
}

LandlockRules::LandlockRules(UniqueFd rules, uint64_t handled)
    : rules_(std::move(rules)), handled_(handled) {}

bool LandlockRules::allow_device(const std::string& node) {
  return allow(node, LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_WRITE_FILE | kControlDevice);
}

bool LandlockRules::allow_listing(const std::string& folder) {
  return allow(folder, LANDLOCK_ACCESS_FS_READ_DIR);
}

bool LandlockRules::allow(const std::string& path, uint64_t rights) {
  const UniqueFd target(::open(path.c_str(), O_PATH | O_CLOEXEC));
  if (!target) return false;
  landlock_path_beneath_attr rule{};
  rule.allowed_access = rights & handled_;
  rule.parent_fd = target.get();
  return ::syscall(SYS_landlock_add_rule, rules_.get(), LANDLOCK_RULE_PATH_BENEATH, &rule, 0) == 0;
}

bool LandlockRules::enforce() const {
  return ::syscall(SYS_landlock_restrict_self, rules_.get(), 0) == 0;
}

std::vector<sock_filter> decoder_filter(Devices devices, bool makes_files) {
  Rules rules;
  for (const int call : kAllowed) rules.add(call, SCMP_ACT_ALLOW);
  // Code injection needs executable memory.
  rules.allow_if(SCMP_SYS(mmap), 2, PROT_EXEC, 0);
  rules.allow_if(SCMP_SYS(mprotect), 2, PROT_EXEC, 0);
  rules.allow_if(SCMP_SYS(clone), 0, CLONE_THREAD, CLONE_THREAD);
  // clone3 takes its flags in memory, which a filter cannot read; with ENOSYS the C library falls
  // back to clone.
  rules.add(SCMP_SYS(clone3), SCMP_ACT_ERRNO(ENOSYS));
  rules.allow_if(SCMP_SYS(prctl), 0, UINT32_MAX, PR_SET_NAME);
  if (devices == Devices::Video) allow_video_devices(rules);
  if (makes_files) {
    rules.add(SCMP_SYS(memfd_create), SCMP_ACT_ALLOW);
    rules.add(SCMP_SYS(socketpair), SCMP_ACT_ALLOW);
  }
  return rules.program();
}

bool die_with(pid_t parent) noexcept {
  (void)prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0);
  return getppid() == parent;
}

void volunteer_for_oom() noexcept {
  const UniqueFd score(open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC));
  constexpr std::array kScore = {'5', '0', '0'};
  (void)!write(score.get(), kScore.data(), kScore.size());
}

void confine(uint64_t extra_bytes, pid_t parent, unsigned descriptors, uint64_t made_file_bytes) {
  ignore_signals();
  if (kSanitized) return;
  // While the process may still open a descriptor.
  std::vector<sock_filter> filter = decoder_filter(Devices::None, made_file_bytes > 0);
  const auto no_files = LandlockRules::create();
  give_up_rights(extra_bytes, parent, descriptors, made_file_bytes);
  if (no_files) (void)no_files->enforce();  // the filter is sufficient without it
  install(std::move(filter));
}

std::string confine_with_devices(uint64_t extra_bytes, pid_t parent,
                                 const std::vector<std::string>& nodes) {
  ignore_signals();
  if (kSanitized) return {};
  std::vector<sock_filter> narrow = decoder_filter();
  std::vector<sock_filter> wide = decoder_filter(Devices::Video);
  auto rules = make_device_rules(nodes);
  int error = errno;
  give_up_rights(extra_bytes, parent, rules ? limit_for_devices() : 1);
  if (rules && !rules->enforce()) {
    error = errno;
    rules.reset();
  }
  install(rules ? std::move(wide) : std::move(narrow));
  if (rules) return {};
  return std::string("the kernel's Landlock cannot confine it: ") + std::strerror(error);
}

}  // namespace lenticule::video
