// SPDX-License-Identifier: Apache-2.0
// Where keys come from: a person at a terminal, or a script that says what a person would press.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "base/terminal_keys.h"

namespace lenticule::player {

/// One thread.
class KeyInput {
 public:
  virtual ~KeyInput() = default;

  /// What was pressed since the last call, in order; waits for nothing.
  [[nodiscard]] virtual std::vector<KeyPress> take() = 0;
  /// No key will come any more.
  [[nodiscard]] virtual bool at_end() const = 0;
  /// Readable when there may be keys; -1 if there is no need to wait.
  [[nodiscard]] virtual int fd() const = 0;
  /// Somebody looks at what is printed.
  [[nodiscard]] virtual bool is_person() const = 0;
};

/// After so long an escape was the escape key and not the start of an arrow.
inline constexpr std::chrono::milliseconds kEscapePause{60};

/// `script` names a file; empty: standard input, as keys if it is a terminal and as a script
/// otherwise. Throws Error(Input) for a script that cannot be read, within 1 MiB.
[[nodiscard]] std::unique_ptr<KeyInput> open_key_input(const std::string& script);

}  // namespace lenticule::player
