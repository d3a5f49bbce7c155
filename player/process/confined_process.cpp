// SPDX-License-Identifier: Apache-2.0
#include "player/process/confined_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

#include "base/packet.h"
#include "player/process/interrupt.h"

namespace lenticule::player {
namespace {

using namespace std::chrono_literals;
using std::chrono::milliseconds;

constexpr milliseconds kLook{200};
/// Timeout for the start: loading some hundred libraries on a busy machine may take long.
constexpr milliseconds kStartTimeout{180'000};
constexpr milliseconds kInterruptedTimeout{2000};
/// A file may take this multiple of the longest silence, so that a process that answers now and
/// then does not go on for ever.
constexpr int kMostSilences = 10;

int checked(int result, const char* program) {
  if (result < 0)
    throw Error(ErrorKind::Failed,
                fmt::format("{}: cannot be started: {}", program, std::strerror(errno)));
  return result;
}

}  // namespace

ConfinedProcess::ConfinedProcess(const ConfinedProgram& program,
                                 const std::vector<std::string>& command, size_t memory_bytes,
                                 milliseconds silence)
    : program_(program), silence_(silence), memory_bytes_(memory_bytes) {
  std::array<int, 2> ends{};
  checked(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()), program.name);
  socket_ = UniqueFd(ends[0]);
  const UniqueFd theirs(ends[1]);
  // The process can change the contents of sealed memory and cannot shrink it, so that reads never
  // fault.
  const UniqueFd memory(
      checked(memfd_create("lenticule-shared", MFD_CLOEXEC | MFD_ALLOW_SEALING), program.name));
  checked(ftruncate(memory.get(), static_cast<off_t>(memory_bytes)), program.name);
  checked(fcntl(memory.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL),
          program.name);
  process_ = Subprocess(command, {{theirs.get(), 0}, {memory.get(), 3}});
  memory_ = mmap(nullptr, memory_bytes, PROT_READ, MAP_SHARED, memory.get(), 0);
  if (memory_ == MAP_FAILED) checked(-1, program.name);
}

ConfinedProcess::~ConfinedProcess() {
  munmap(memory_, memory_bytes_);
}

bool ConfinedProcess::is_alive() const {
  pollfd stream{.fd = socket_.get(), .events = 0, .revents = 0};
  return poll(&stream, 1, 0) == 0;
}

void ConfinedProcess::limit_from_here(milliseconds limit) {
  processor_begin_ = processor_time();
  processor_limit_ = limit;
  silent_since_ = answered_ = begun_ = Clock::now();
}

milliseconds ConfinedProcess::processor_time() const {
  clockid_t clock{};
  timespec used{};
  if (clock_getcpuclockid(process_.pid(), &clock) != 0 || clock_gettime(clock, &used) != 0)
    return 0ms;
  return std::chrono::duration_cast<milliseconds>(std::chrono::seconds(used.tv_sec) +
                                                  std::chrono::nanoseconds(used.tv_nsec));
}

void ConfinedProcess::send_bytes(const void* bytes, size_t count, int descriptor) {
  if (!send_packet(socket_.get(), bytes, count, descriptor, MSG_DONTWAIT)) fail_dead();
}

void ConfinedProcess::wait_for_bytes(void* bytes, size_t count, UniqueFd* descriptor) {
  while (true) {
    check_time();  // also of a process that always answers at once
    pollfd stream{.fd = socket_.get(), .events = POLLIN, .revents = 0};
    (void)poll(&stream, 1, static_cast<int>(kLook.count()));
    if (stream.revents != 0) {
      const ssize_t n = receive_packet(socket_.get(), bytes, count, descriptor, MSG_DONTWAIT);
      if (n == 0 || (n < 0 && errno != EAGAIN)) fail_dead();
      if (n > 0 && n != static_cast<ssize_t>(count)) fail_protocol();
      if (n > 0) {
        silent_since_ = answered_ = Clock::now();
        return;
      }
    }
  }
}

void ConfinedProcess::check_time() {
  using std::chrono::duration_cast;
  using std::chrono::seconds;
  const milliseconds used = processor_time();
  if (ready_ && used > processor_begin_ + processor_limit_)
    throw Error(ErrorKind::Input,
                fmt::format("{}: not read after {:.3g} s of processor time, the limit of this file",
                            name_, std::chrono::duration<double>(processor_limit_).count()),
                program_.remedy);
  if (std::exchange(processor_seen_, used) != used) silent_since_ = Clock::now();
  if (waits_for_us_ && waits_for_us_()) silent_since_ = Clock::now();
  const auto silence = Clock::now() - silent_since_;
  const milliseconds longest = ready_ ? silence_ : kStartTimeout;
  if (silence > longest)
    throw Error(ErrorKind::Input,
                fmt::format("{}: its {} did not respond for {} s", name_, program_.role,
                            duration_cast<seconds>(longest).count()),
                program_.remedy);
  const milliseconds all = std::max(kMostSilences * silence_, 2 * processor_limit_);
  if (ready_ && Clock::now() - begun_ > all)
    throw Error(ErrorKind::Input,
                fmt::format("{}: not read after {} s", name_, duration_cast<seconds>(all).count()),
                program_.remedy);
  if (interrupted() && Clock::now() - answered_ > kInterruptedTimeout)
    throw Error(ErrorKind::Failed, fmt::format("{}: interrupted", name_));
}

void ConfinedProcess::fail_protocol() const {
  throw Error(ErrorKind::Input,
              fmt::format("{}: its {} answered out of order", name_, program_.role),
              program_.remedy);
}

void ConfinedProcess::fail_dead() {
  // A process that closed its socket and still runs is not usable.
  const ProcessEnd end = process_.end();
  const std::string how = end.signal != 0 ? fmt::format("was ended by signal {}", end.signal)
                                          : fmt::format("ended with exit code {}", end.exit_code);
  if (ready_)
    throw Error(ErrorKind::Input, fmt::format("{}: its {} {}", name_, program_.role, how),
                program_.remedy);
  throw Error(ErrorKind::Failed, fmt::format("{}: {} before its first file", program_.name, how),
              fmt::format("restart the player or the command if it was upgraded; else reinstall "
                          "{}, or use a kernel "
                          "with seccomp filters",
                          program_.package));
}

}  // namespace lenticule::player
