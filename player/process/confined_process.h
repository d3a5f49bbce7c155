// SPDX-License-Identifier: Apache-2.0
// ConfinedProcess is a process without rights that reads files of strangers for this one: a decoder
// of pictures, or a reader of models. This process sends it packets with descriptors over a socket,
// and takes the results from shared memory. All that it answers is checked.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/packet.h"
#include "base/subprocess.h"
#include "base/unique_fd.h"
#include "player/process/interrupt.h"

namespace lenticule::player {

/// ConfinedProgram is a program that confines itself before it reads a file.
struct ConfinedProgram {
  const char* name;     ///< for example "lenticule-video"
  const char* role;     ///< what its process is to a file, for example "decoder"
  const char* package;  ///< package that installs it
  const char* remedy;   ///< for files that it cannot read
};

/// Thread safety: one thread at a time.
class ConfinedProcess {
 public:
  using milliseconds = std::chrono::milliseconds;

  /// Starts a process with a socket as descriptor 0 and `memory_bytes` of shared memory as
  /// descriptor 3. The first packet that it sends says that it is confined. Call it on a thread
  /// that outlives the process, because the kernel kills the process when that thread ends. Throws
  /// Error(Failed).
  ConfinedProcess(const ConfinedProgram& program, const std::vector<std::string>& command,
                  size_t memory_bytes, milliseconds silence)
      : program_(program), silence_(silence), memory_bytes_(memory_bytes) {
    std::array<int, 2> ends{};
    checked(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()), program.name);
    socket_ = UniqueFd(ends[0]);
    const UniqueFd theirs(ends[1]);
    // The process can change the contents of sealed memory and cannot shrink it, so that reads
    // never fault.
    const UniqueFd memory(
        checked(memfd_create("lenticule-shared", MFD_CLOEXEC | MFD_ALLOW_SEALING), program.name));
    checked(ftruncate(memory.get(), static_cast<off_t>(memory_bytes)), program.name);
    checked(fcntl(memory.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL),
            program.name);
    process_ = Subprocess(command, {{theirs.get(), 0}, {memory.get(), 3}});
    memory_ = mmap(nullptr, memory_bytes, PROT_READ, MAP_SHARED, memory.get(), 0);
    if (memory_ == MAP_FAILED) checked(-1, program.name);
  }
  ~ConfinedProcess() { munmap(memory_, memory_bytes_); }

  [[nodiscard]] pid_t pid() const { return process_.pid(); }
  /// Returns false if the process has ended, for example because the kernel needed its memory.
  [[nodiscard]] bool is_alive() const {
    pollfd stream{.fd = socket_.get(), .events = 0, .revents = 0};
    return poll(&stream, 1, 0) == 0;
  }
  /// Returns the shared memory, which the process may change at any time.
  [[nodiscard]] const uint8_t* memory() const { return static_cast<const uint8_t*>(memory_); }

  /// Begins a file; the name is for errors. Starting is not part of it: on a slow machine, loading
  /// some hundred libraries takes more processor time than most files. As long as `waits_for_us`
  /// returns true, the process need not answer.
  template <class Packet>
  void begin(const std::string& name, milliseconds processor_time,
             std::function<bool()> waits_for_us = {}) {
    name_ = name;
    waits_for_us_ = std::move(waits_for_us);
    if (!ready_) {
      silent_since_ = answered_ = begun_ = Clock::now();
      (void)receive<Packet>();
      ready_ = true;
    }
    limit_from_here(processor_time);
  }
  void allow_more(milliseconds processor_time) { processor_limit_ += processor_time; }

  template <class Packet>
  void send(const Packet& packet, int descriptor = -1) {
    send_bytes(&packet, sizeof packet, descriptor);
  }
  /// Waits for a packet, and for a descriptor if one is wanted. Throws Error(Input) with the name
  /// of the file if the process ends, sends something else or exceeds its limits.
  template <class Packet>
  [[nodiscard]] Packet receive(UniqueFd* descriptor = nullptr) {
    Packet packet;
    wait_for_bytes(&packet, sizeof packet, descriptor);
    return packet;
  }

  [[noreturn]] void fail_protocol() const {
    fail_file(fmt::format("its {} answered out of order", program_.role));
  }

 private:
  static constexpr std::chrono::milliseconds kLook{200};
  /// Timeout for the start: loading some hundred libraries on a busy machine may take long.
  static constexpr std::chrono::milliseconds kStartTimeout{180'000};
  static constexpr std::chrono::milliseconds kInterruptedTimeout{2000};
  /// A file may take this multiple of the longest silence, so that a process that answers now and
  /// then does not go on for ever.
  static constexpr int kMostSilences = 10;

  static int checked(int result, const char* program) {
    if (result < 0) throw failed_error("{}: cannot be started: {}", program, std::strerror(errno));
    return result;
  }
  using Clock = std::chrono::steady_clock;

  [[noreturn]] void fail_file(const std::string& cause) const {
    throw input_error("{}: {}", name_, cause).remedy(program_.remedy);
  }
  void send_bytes(const void* bytes, size_t count, int descriptor) {
    if (!send_packet(socket_.get(), bytes, count, descriptor, MSG_DONTWAIT)) fail_dead();
  }
  void wait_for_bytes(void* bytes, size_t count, UniqueFd* descriptor) {
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
  void limit_from_here(milliseconds limit) {
    processor_begin_ = processor_time();
    processor_limit_ = limit;
    silent_since_ = answered_ = begun_ = Clock::now();
  }
  void check_time() {
    using std::chrono::duration_cast;
    using std::chrono::seconds;
    const std::chrono::milliseconds used = processor_time();
    if (ready_ && used > processor_begin_ + processor_limit_)
      fail_file(fmt::format("not read after {:.3g} s of processor time, the limit of this file",
                            std::chrono::duration<double>(processor_limit_).count()));
    if (std::exchange(processor_seen_, used) != used) silent_since_ = Clock::now();
    if (waits_for_us_ && waits_for_us_()) silent_since_ = Clock::now();
    const auto silence = Clock::now() - silent_since_;
    const std::chrono::milliseconds longest = ready_ ? silence_ : kStartTimeout;
    if (silence > longest)
      fail_file(fmt::format("its {} did not respond for {} s", program_.role,
                            duration_cast<seconds>(longest).count()));
    const std::chrono::milliseconds all = std::max(kMostSilences * silence_, 2 * processor_limit_);
    if (ready_ && Clock::now() - begun_ > all)
      fail_file(fmt::format("not read after {} s", duration_cast<seconds>(all).count()));
    if (interrupted() && Clock::now() - answered_ > kInterruptedTimeout) throw Interrupted(name_);
  }
  [[nodiscard]] milliseconds processor_time() const {
    clockid_t clock{};
    timespec used{};
    if (clock_getcpuclockid(process_.pid(), &clock) != 0 || clock_gettime(clock, &used) != 0)
      return milliseconds(0);
    return std::chrono::duration_cast<std::chrono::milliseconds>(
        std::chrono::seconds(used.tv_sec) + std::chrono::nanoseconds(used.tv_nsec));
  }
  [[noreturn]] void fail_dead() {
    // A process that closed its socket and still runs is not usable.
    const ProcessEnd end = process_.end();
    const std::string how = end.signal != 0 ? fmt::format("was ended by signal {}", end.signal)
                                            : fmt::format("ended with exit code {}", end.exit_code);
    if (ready_) fail_file(fmt::format("its {} {}", program_.role, how));
    throw failed_error("{}: {} before its first file", program_.name, how)
        .remedy(fmt::format("restart the player or the command if it was upgraded; else reinstall "
                            "{}, or use a kernel with seccomp filters",
                            program_.package));
  }

  ConfinedProgram program_;
  milliseconds silence_;
  size_t memory_bytes_;
  void* memory_ = nullptr;
  UniqueFd socket_;
  Subprocess process_;
  std::string name_;
  std::function<bool()> waits_for_us_;
  bool ready_ = false;  ///< reported that its sandbox is active
  milliseconds processor_begin_{0};
  milliseconds processor_limit_{0};
  Clock::time_point begun_;
  milliseconds processor_seen_{0};
  Clock::time_point silent_since_;  ///< neither answered nor computed since
  Clock::time_point answered_;
};

}  // namespace lenticule::player
