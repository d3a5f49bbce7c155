// SPDX-License-Identifier: Apache-2.0
// Decodes the keys of calibration by eye: from a terminal's bytes, and from scripts.
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
  Coarser,       ///< +  larger steps
  Finer,         ///< -  smaller steps
  Next,          ///< enter: confirm and continue; at the last step: save
  Back,          ///< backspace: the previous step
  Undo,          ///< u
  Redo,          ///< r
  Compare,       ///< space: toggle between the initial and the current values
  Restore,       ///< escape: restore all initial values
  SwapEyes,      ///< i  shift by half a lens: left and right eye swap
  OtherPattern,  ///< f  toggle between the bright comb and red and green
  Magnifier,     ///< m
  Words,         ///< t  show or hide the text on the panel
  Quit,          ///< q  leave without saving
};

/// Stride is the step size of one key press.
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

/// Returns for example "shift+left".
[[nodiscard]] std::string to_string(const KeyPress& press);

/// Limits the presses in one script, repetitions included.
inline constexpr int kMaxScriptPresses = 100'000;

/// Parses words as to_string() writes them, separated by spaces or line ends. "left*12" is twelve
/// presses, and the text after a # on a line is a comment. Throws Error(Input) "source:line:
/// cause".
[[nodiscard]] std::vector<KeyPress> parse_key_script(std::string_view text,
                                                     const std::string& source);

/// KeyDecoder turns the bytes of a terminal into key presses. Input is untrusted: unknown bytes and
/// sequences are dropped.
class KeyDecoder {
 public:
  /// Returns the key press that this byte completes, if any.
  [[nodiscard]] std::optional<KeyPress> feed(char byte);
  /// Ends a pause in the input: an escape byte without a successor is the escape key itself.
  [[nodiscard]] std::optional<KeyPress> pause();
  /// Returns true while the last bytes may still be the start of a longer sequence.
  [[nodiscard]] bool is_waiting() const { return !pending_.empty(); }

 private:
  std::string pending_;  ///< the bytes since the last escape, a few at most
};

}  // namespace lenticule
