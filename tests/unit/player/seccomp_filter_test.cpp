// SPDX-License-Identifier: Apache-2.0
// Makes system calls in child processes that run under the decoder's filter.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/audit.h>
#include <linux/sched.h>
#include <linux/seccomp.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <set>
#include <vector>

#include "apps/lenticule-video/confinement.h"

namespace lenticule::video {
namespace {

constexpr int kPassed = 0;
constexpr int kNotConfined = 250;
constexpr unsigned kMostSeconds = 20;

/// Calls that are allowed with any arguments and that return an error for wrong ones.
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
    SYS_rseq,
    SYS_rt_sigaction,
    SYS_rt_sigprocmask,
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
#ifdef SYS_poll
    SYS_poll,
#endif
};
/// Calls that are tested one by one, because they do not return or depend on an argument.
constexpr std::array kSpecial = {
    SYS_rt_sigreturn,
    SYS_exit,
    SYS_exit_group,
    SYS_mmap,
    SYS_mprotect,
    SYS_clone,
    SYS_clone3,
    SYS_prctl,
#if defined(__x86_64__)
    335,
    336,  // uretprobe and uprobe: the kernel makes them itself, without asking a filter
#endif
};
constexpr long kMostNumber = 600;  ///< larger than that of any call of Linux

bool install(std::vector<sock_filter> code) {
  const sock_fprog program{.len = static_cast<unsigned short>(code.size()), .filter = code.data()};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) == 0;
}

/// Returns the wait status of a child process that runs `body` under the filter and exits with its
/// result. A child that hangs is ended by SIGALRM.
int status_of(const std::function<int()>& body, Devices devices = Devices::None) {
  const std::vector<sock_filter> code = decoder_filter(devices);
  const pid_t child = fork();
  if (child == 0) {
    alarm(kMostSeconds);
    const bool confined = install(code);
    syscall(SYS_exit_group, confined ? body() : kNotConfined);
  }
  int status = -1;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  return status;
}

void expect_exit_code(int status, int code) {
  ASSERT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), code);
}

/// Returns the errno value of the call; 0 if it succeeded.
int error_of(long number, long a = -1, long b = -1, long c = -1, long d = -1, long e = -1,
             long f = -1) {
  return syscall(number, a, b, c, d, e, f) == -1 ? errno : 0;
}

/// Expects `body` to return true under the filter.
void expect_under_filter(const std::function<bool()>& body, Devices devices = Devices::None) {
  expect_exit_code(status_of([&] { return body() ? kPassed : 1; }, devices), kPassed);
}

/// Returns the errno values of the calls, made with wrong arguments under the filter.
std::vector<int> errors_of(const std::vector<long>& numbers, Devices devices = Devices::None) {
  const size_t bytes = numbers.size() * sizeof(int);
  void* const shared =
      mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared == MAP_FAILED) return {};
  auto* const errors = static_cast<int*>(shared);
  expect_under_filter(
      [&] {
        for (size_t i = 0; i < numbers.size(); ++i) errors[i] = error_of(numbers[i]);
        return true;
      },
      devices);
  std::vector<int> result(errors, errors + numbers.size());
  munmap(shared, bytes);
  return result;
}

TEST(SeccompFilter, AllowsTheCallsOfADecoder) {
  const std::vector<long> numbers(kAllowed.begin(), kAllowed.end());
  const std::vector<int> errors = errors_of(numbers);
  ASSERT_EQ(errors.size(), numbers.size());
  for (size_t i = 0; i < errors.size(); ++i) EXPECT_NE(errors[i], EPERM) << "call " << numbers[i];
}

TEST(SeccompFilter, RefusesEveryOtherCall) {
  std::set<long> named(kAllowed.begin(), kAllowed.end());
  named.insert(kSpecial.begin(), kSpecial.end());
  std::vector<long> numbers;
  for (long number = 0; number <= kMostNumber; ++number)
    if (!named.contains(number)) numbers.push_back(number);
  const std::vector<int> errors = errors_of(numbers);
  ASSERT_EQ(errors.size(), numbers.size());
  for (size_t i = 0; i < errors.size(); ++i) EXPECT_EQ(errors[i], EPERM) << "call " << numbers[i];
}

TEST(SeccompFilter, WithVideoDevicesAllowsToOpenAndListAndNoOtherCallMore) {
  const std::set<long> more = {SYS_openat, SYS_getdents64};
  std::vector<long> numbers(more.begin(), more.end());
  for (const int error : errors_of(numbers, Devices::Video)) EXPECT_NE(error, EPERM);
  numbers.clear();
  std::set<long> named(kAllowed.begin(), kAllowed.end());
  named.insert(kSpecial.begin(), kSpecial.end());
  named.insert(more.begin(), more.end());
  named.insert(SYS_newfstatat);  // with all bits of its flags set; tested below
  for (long number = 0; number <= kMostNumber; ++number)
    if (!named.contains(number)) numbers.push_back(number);
  const std::vector<int> errors = errors_of(numbers, Devices::Video);
  ASSERT_EQ(errors.size(), numbers.size());
  for (size_t i = 0; i < errors.size(); ++i) EXPECT_EQ(errors[i], EPERM) << "call " << numbers[i];
}

/// Requests are made on a pipe, which knows none of them.
TEST(SeccompFilter, WithVideoDevicesAllowsRequestsOfVideoDevicesOnly) {
  std::array<int, 2> ends{};
  ASSERT_EQ(pipe(ends.data()), 0);
  const auto refuses = [&](unsigned long request, int error) {
    expect_under_filter([&] { return error_of(SYS_ioctl, ends[0], long(request), 0) == error; },
                        Devices::Video);
  };
  for (const unsigned long request : {VIDIOC_QUERYCAP, VIDIOC_QBUF, VIDIOC_STREAMON})
    refuses(request, ENOTTY);
  for (const unsigned long request : {TIOCSTI, TIOCLINUX, TCGETS, FIONREAD})
    refuses(request, EPERM);
  refuses(_IO('U', 0), EPERM);
  refuses(_IO('W', 0), EPERM);
  expect_under_filter([&] { return error_of(SYS_ioctl, ends[0], VIDIOC_QBUF, 0) == EPERM; });
  for (const int end : ends) close(end);
}

TEST(SeccompFilter, WithVideoDevicesAllowsTheStateOfOpenFilesOnly) {
  struct stat status {};
  const auto at = reinterpret_cast<long>(&status);
  const auto empty = reinterpret_cast<long>("");
  const auto root = reinterpret_cast<long>("/");
  expect_under_filter(
      [&] { return error_of(SYS_newfstatat, STDERR_FILENO, empty, at, AT_EMPTY_PATH) == 0; },
      Devices::Video);
  expect_under_filter([&] { return error_of(SYS_newfstatat, AT_FDCWD, root, at, 0) == EPERM; },
                      Devices::Video);
}

TEST(SeccompFilter, AllowsToExit) {
  expect_exit_code(status_of([] { return error_of(SYS_exit, 7); }), 7);
  expect_exit_code(status_of([] { return error_of(SYS_exit_group, 8); }), 8);
}

TEST(SeccompFilter, RefusesExecutableMemory) {
  const long page = sysconf(_SC_PAGESIZE);
  const auto mapped = [page](long protection) {
    return error_of(SYS_mmap, 0, page, protection, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  };
  expect_under_filter([&] { return mapped(PROT_READ | PROT_WRITE) == 0; });
  expect_under_filter([&] { return mapped(PROT_READ | PROT_EXEC) == EPERM; });
  void* const memory = mmap(nullptr, static_cast<size_t>(page), PROT_READ | PROT_WRITE,
                            MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(memory, MAP_FAILED);
  const auto at = reinterpret_cast<long>(memory);
  expect_under_filter([&] { return error_of(SYS_mprotect, at, page, PROT_READ) == 0; });
  expect_under_filter(
      [&] { return error_of(SYS_mprotect, at, page, PROT_READ | PROT_EXEC) == EPERM; });
  munmap(memory, static_cast<size_t>(page));
}

/// The kernel refuses CLONE_THREAD without CLONE_SIGHAND with EINVAL, so no thread is made here.
TEST(SeccompFilter, AllowsThreadsButNoProcesses) {
  expect_under_filter([] { return error_of(SYS_clone, CLONE_THREAD, 0, 0, 0, 0) == EINVAL; });
  expect_under_filter([] { return error_of(SYS_clone, SIGCHLD, 0, 0, 0, 0) == EPERM; });
  expect_under_filter([] { return error_of(SYS_clone3, 0, 0) == ENOSYS; });
}

TEST(SeccompFilter, AllowsToNameAThreadAndNoOtherSetting) {
  const auto name = reinterpret_cast<long>("decoder");
  expect_under_filter([name] { return error_of(SYS_prctl, PR_SET_NAME, name) == 0; });
  expect_under_filter([] { return error_of(SYS_prctl, PR_GET_DUMPABLE, 0, 0, 0, 0) == EPERM; });
}

void* g_page = nullptr;

TEST(SeccompFilter, SignalHandlersReturn) {
  const auto bytes = static_cast<size_t>(sysconf(_SC_PAGESIZE));
  g_page = mmap(nullptr, bytes, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(g_page, MAP_FAILED);
  expect_under_filter([] {
    const auto make_writable = [](int) {
      mprotect(g_page, static_cast<size_t>(sysconf(_SC_PAGESIZE)), PROT_READ | PROT_WRITE);
    };
    std::signal(SIGSEGV, make_writable);
    volatile auto* const byte = static_cast<volatile char*>(g_page);
    *byte = 1;  // faults; is repeated when the handler returns
    return *byte == 1;
  });
  munmap(g_page, bytes);
}

/// Evaluates the instructions that filters of system calls use.
uint32_t action_of(const std::vector<sock_filter>& code, uint32_t architecture, int number) {
  seccomp_data call{};
  call.arch = architecture;
  call.nr = number;
  uint32_t word = 0;
  for (size_t at = 0; at < code.size(); ++at) {
    const sock_filter& step = code[at];
    const auto jump = [&](bool taken) { at += taken ? step.jt : step.jf; };
    switch (step.code) {
      case BPF_LD | BPF_W | BPF_ABS:
        std::copy_n(reinterpret_cast<const std::byte*>(&call) + step.k, sizeof word,
                    reinterpret_cast<std::byte*>(&word));
        break;
      case BPF_ALU | BPF_AND | BPF_K:
        word &= step.k;
        break;
      case BPF_JMP | BPF_JA:
        at += step.k;
        break;
      case BPF_JMP | BPF_JEQ | BPF_K:
        jump(word == step.k);
        break;
      case BPF_JMP | BPF_JGE | BPF_K:
        jump(word >= step.k);
        break;
      case BPF_JMP | BPF_JGT | BPF_K:
        jump(word > step.k);
        break;
      case BPF_RET | BPF_K:
        return step.k;
      default:
        ADD_FAILURE() << "instruction " << step.code;
        return 0;
    }
  }
  ADD_FAILURE() << "no action";
  return 0;
}

TEST(SeccompFilter, KillsTheProcessForCallsOfAnotherArchitecture) {
  const std::vector<sock_filter> code = decoder_filter();
  for (const auto foreign :
       std::array<uint32_t, 3>{AUDIT_ARCH_I386, AUDIT_ARCH_ARM, AUDIT_ARCH_S390})
    for (int number = 0; number < kMostNumber; ++number)
      ASSERT_EQ(action_of(code, foreign, number), SECCOMP_RET_KILL_PROCESS);
#if defined(__x86_64__)
  EXPECT_EQ(action_of(code, AUDIT_ARCH_X86_64, SYS_read), SECCOMP_RET_ALLOW);
  constexpr long kX32 = 0x40000000;
  const int status = status_of([] { return error_of(kX32 + SYS_getpid); });
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGSYS);
#endif
}

/// systemd kills a service that calls seccomp(2), which is not among its @system-service.
TEST(SeccompFilter, IsMadeAndInstalledWithoutSeccomp2) {
  const pid_t child = fork();
  if (child == 0) {
    const auto nr = static_cast<uint32_t>(offsetof(seccomp_data, nr));
    const bool ready = install({BPF_STMT(BPF_LD | BPF_W | BPF_ABS, nr),
                                BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_seccomp, 0, 1),
                                BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
                                BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)});
    const bool confined = ready && install(decoder_filter());
    syscall(SYS_exit_group, confined && error_of(SYS_openat) == EPERM ? kPassed : 1);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  expect_exit_code(status, kPassed);
}

}  // namespace
}  // namespace lenticule::video
