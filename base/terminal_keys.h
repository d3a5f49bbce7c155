// SPDX-License-Identifier: Apache-2.0
// The keys of calibration by eye: what a person presses, how terminals send it, and how scripts
// write it.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace lenticule {

enum class Key {
  Left,
  Right,
  Up,
  Down,
  SlantLess,     ///< [
  SlantMore,     ///< ]
  Coarser,       ///< +  larger steps from now on
  Finer,         ///< -  smaller steps from now on
  Next,          ///< enter: take this and go on; at the last step: save
  Back,          ///< backspace: the step before
  Undo,          ///< u
  Redo,          ///< r
  Compare,       ///< space: as it was, as it is now
  Restore,       ///< escape: everything as it was at the start
  SwapEyes,      ///< i  half a lens further: left and right eye change places
  OtherPattern,  ///< f  between bright comb and red and green
  Magnifier,     ///< m
  Words,         ///< t  words on the panel or not
  Quit,          ///< q  leave without saving
};

/// How far one press goes.
enum class Stride {
  Normal,
  Coarse,  ///< ten times: shift, or page up and page down
  Fine,    ///< a tenth: ctrl
};

struct KeyPress {
  Key key = Key::Next;
  Stride stride = Stride::Normal;
  friend bool operator==(const KeyPress&, const KeyPress&) = default;
};

/// "shift+left"
[[nodiscard]] std::string to_string(const KeyPress& press);

/// No script may hold more presses, repetitions counted.
inline constexpr int kMaxScriptPresses = 100'000;

/// Words as to_string() writes them, between spaces or on lines of their own; "left*12" is twelve
/// presses, and what follows a # on a line is a remark. Throws Error(Input) "source:line: cause".
[[nodiscard]] std::vector<KeyPress> parse_key_script(std::string_view text,
                                                     const std::string& source);

/// Turns what a terminal sends into presses. Nothing that it may be fed can do harm: unknown bytes
/// and sequences are dropped.
class KeyDecoder {
 public:
  /// The press that this byte completes, if any.
  [[nodiscard]] std::optional<KeyPress> feed(char byte);
  /// An escape that nothing followed for a while is the escape key itself.
  [[nodiscard]] std::optional<KeyPress> pause();
  /// True while more bytes may belong to what came last.
  [[nodiscard]] bool is_waiting() const { return !pending_.empty(); }

 private:
  std::string pending_;  ///< from the escape on, a few bytes at most
};

}  // namespace lenticule
