// SPDX-License-Identifier: Apache-2.0
// Waits for what another thread or process does.
#pragma once

#include <chrono>
#include <thread>

namespace lenticule::test {

/// Waits until the condition is true. Returns false after a minute, which is beyond the slowest
/// machine's needs.
template <typename Condition>
[[nodiscard]] bool comes_true(const Condition& condition,
                              std::chrono::milliseconds pause = std::chrono::milliseconds(5),
                              std::chrono::seconds timeout = std::chrono::seconds(60)) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(pause);
  }
  return true;
}

}  // namespace lenticule::test
