// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-video/seccomp_filter.h"

#include <linux/audit.h>
#include <linux/sched.h>
#include <linux/seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>

namespace lenticule::video {
namespace {

#if defined(__x86_64__)
constexpr uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
#error "say which audit architecture this is"
#endif
constexpr uint32_t kForeignNumbers = 0x40000000;  ///< x32 calls on x86-64

/// Calls for open descriptors, memory, threads, time and exit.
constexpr std::array kAllowed = {
    SYS_read,
    SYS_pread64,
    SYS_readv,
    SYS_write,
    SYS_writev,
    SYS_lseek,
    SYS_close,
    SYS_fstat,
    SYS_sendmsg,
    SYS_recvmsg,
    SYS_ppoll,
    SYS_munmap,
    SYS_mremap,
    SYS_madvise,
    SYS_brk,
    SYS_futex,
    SYS_rt_sigaction,
    SYS_rt_sigprocmask,
    SYS_rt_sigreturn,
    SYS_sigaltstack,
    SYS_set_robust_list,
    SYS_sched_yield,
    SYS_sched_getaffinity,
    SYS_getpid,
    SYS_gettid,
    SYS_getrandom,
    SYS_clock_gettime,
    SYS_clock_nanosleep,
    SYS_nanosleep,
    SYS_gettimeofday,
    SYS_restart_syscall,
    SYS_exit,
    SYS_exit_group,
#ifdef SYS_rseq
    SYS_rseq,
#endif
#ifdef SYS_poll
    SYS_poll,
#endif
};

class Program {
 public:
  void load(size_t offset) {
    code_.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<uint32_t>(offset)));
  }
  void answer(uint32_t action) { code_.push_back(BPF_STMT(BPF_RET | BPF_K, action)); }
  /// Skips `steps` instructions unless the loaded word is `value`.
  void unless_equal(uint32_t value, uint8_t steps) {
    code_.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, steps));
  }
  void skip_if_below(uint32_t value, uint8_t steps) {
    code_.push_back(BPF_JUMP(BPF_JMP | BPF_JGE | BPF_K, value, 0, steps));
  }
  void unless_any_bit(uint32_t bits, uint8_t steps) {
    code_.push_back(BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, bits, 0, steps));
  }
  [[nodiscard]] std::vector<sock_filter> take() { return std::move(code_); }

 private:
  std::vector<sock_filter> code_;
};

constexpr uint32_t kDenied = SECCOMP_RET_ERRNO | EPERM;

size_t argument(size_t index) {
  return offsetof(seccomp_data, args) + index * sizeof(uint64_t);  // low word: little-endian
}

void check_architecture(Program& program) {
  program.load(offsetof(seccomp_data, arch));
  program.unless_equal(kArchitecture, 2);
  program.load(offsetof(seccomp_data, nr));
  program.skip_if_below(kForeignNumbers, 1);
  program.answer(SECCOMP_RET_KILL_PROCESS);
}

/// Allows the call without PROT_EXEC, because code injection needs executable memory.
void allow_without_exec(Program& program, long call) {
  program.unless_equal(static_cast<uint32_t>(call), 4);
  program.load(argument(2));
  program.unless_any_bit(PROT_EXEC, 1);
  program.answer(kDenied);
  program.answer(SECCOMP_RET_ALLOW);
}

void allow_threads(Program& program) {
  program.unless_equal(SYS_clone, 4);
  program.load(argument(0));
  program.unless_any_bit(CLONE_THREAD, 1);
  program.answer(SECCOMP_RET_ALLOW);
  program.answer(kDenied);
#ifdef SYS_clone3
  // clone3 takes its flags in memory, which a filter cannot read; with ENOSYS the C library falls
  // back to clone.
  program.unless_equal(SYS_clone3, 1);
  program.answer(SECCOMP_RET_ERRNO | ENOSYS);
#endif
}

void allow_thread_names(Program& program) {
  program.unless_equal(SYS_prctl, 4);
  program.load(argument(0));
  program.unless_equal(PR_SET_NAME, 1);
  program.answer(SECCOMP_RET_ALLOW);
  program.answer(kDenied);
}

}  // namespace

std::vector<sock_filter> decoder_filter() {
  Program program;
  check_architecture(program);
  for (const long call : kAllowed) {
    program.unless_equal(static_cast<uint32_t>(call), 1);
    program.answer(SECCOMP_RET_ALLOW);
  }
  allow_without_exec(program, SYS_mmap);
  allow_without_exec(program, SYS_mprotect);
  allow_threads(program);
  allow_thread_names(program);
  program.answer(kDenied);
  return program.take();
}

}  // namespace lenticule::video
