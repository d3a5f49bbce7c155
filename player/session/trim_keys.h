// SPDX-License-Identifier: Apache-2.0
// TrimKeys reads keys from the terminal while a source plays, and applies them to the trim.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include "base/wake_fd.h"
#include "player/session/key_input.h"
#include "player/sources/live_trim.h"

namespace lenticule::player {

class TrimKeys {
 public:
  /// Prints the trim's advice after the first change. Throws Error(Usage) if standard input is not
  /// a terminal.
  explicit TrimKeys(std::shared_ptr<LiveTrim> trim);
  /// Restores the terminal.
  ~TrimKeys();
  TrimKeys(const TrimKeys&) = delete;
  TrimKeys& operator=(const TrimKeys&) = delete;

 private:
  void listen() noexcept;
  void report(const std::string& sentence);

  std::shared_ptr<LiveTrim> trim_;
  bool advised_ = false;
  std::unique_ptr<KeyInput> keys_;
  WakeFd wake_;
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

}  // namespace lenticule::player
