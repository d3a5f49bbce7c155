// SPDX-License-Identifier: Apache-2.0
// Listens to the terminal while something else plays, and hands its keys to the trim.
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
  /// `advice` is said after the first change: what it means for what is playing. Throws
  /// Error(Usage) where standard input is no terminal.
  TrimKeys(std::shared_ptr<LiveTrim> trim, std::string advice);
  /// Gives the terminal back.
  ~TrimKeys();
  TrimKeys(const TrimKeys&) = delete;
  TrimKeys& operator=(const TrimKeys&) = delete;

 private:
  void listen() noexcept;
  void tell(const std::string& sentence);

  std::shared_ptr<LiveTrim> trim_;
  std::string advice_;
  std::unique_ptr<KeyInput> keys_;
  WakeFd wake_;
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

}  // namespace lenticule::player
