// SPDX-License-Identifier: Apache-2.0
// ConfinedProcess is a process without rights that reads files of strangers for this one: a decoder
// of pictures, or a reader of models. This process sends it packets with descriptors over a socket,
// and takes the results from shared memory. All that it answers is checked.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/subprocess.h"
#include "base/unique_fd.h"

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
                  size_t memory_bytes, milliseconds silence);
  ~ConfinedProcess();
  ConfinedProcess(const ConfinedProcess&) = delete;
  ConfinedProcess& operator=(const ConfinedProcess&) = delete;

  [[nodiscard]] pid_t pid() const { return process_.pid(); }
  /// Returns false if the process has ended, for example because the kernel needed its memory.
  [[nodiscard]] bool is_alive() const;
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

  [[noreturn]] void fail_protocol() const;

 private:
  using Clock = std::chrono::steady_clock;

  void send_bytes(const void* bytes, size_t count, int descriptor);
  void wait_for_bytes(void* bytes, size_t count, UniqueFd* descriptor);
  void limit_from_here(milliseconds processor_time);
  void check_time();
  [[nodiscard]] milliseconds processor_time() const;
  [[noreturn]] void fail_dead();

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
