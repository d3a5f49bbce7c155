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
  /// `advice` is printed after the first change and explains its effect on the playing source.
  /// Throws Error(Usage) if standard input is not a terminal.
  TrimKeys(std::shared_ptr<LiveTrim> trim, std::string advice);
  /// Restores the terminal.
  ~TrimKeys();
  TrimKeys(const TrimKeys&) = delete;
  TrimKeys& operator=(const TrimKeys&) = delete;

 private:
  void listen() noexcept;
  void report(const std::string& sentence);

  std::shared_ptr<LiveTrim> trim_;
  std::string advice_;
  std::unique_ptr<KeyInput> keys_;
  WakeFd wake_;
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

}  // namespace lenticule::player
