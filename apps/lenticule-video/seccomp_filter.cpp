// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-video/seccomp_filter.h"

#include <fcntl.h>
#include <linux/sched.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>

#include "base/error.h"
#include "base/unique_fd.h"

namespace lenticule::video {
namespace {

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
    throw Error(ErrorKind::Failed,
                std::string("decoder: cannot create the filter of system calls: ") +
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
  struct Release {
    void operator()(scmp_filter_ctx context) const { seccomp_release(context); }
  };
  std::unique_ptr<void, Release> context_;
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

}  // namespace

std::vector<sock_filter> decoder_filter(Devices devices) {
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
  return rules.program();
}

}  // namespace lenticule::video
