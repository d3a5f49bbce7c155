// SPDX-License-Identifier: Apache-2.0
// Decodes the keys of calibration by eye: from a terminal's bytes, and from scripts.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/numbers.h"

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

/// Limits the presses in one script, repetitions included.
inline constexpr int kMaxScriptPresses = 100'000;

struct NamedKey {
  Key key;
  std::string_view word;
  char byte;  ///< byte that a terminal sends; 0 if the terminal sends a sequence
};

inline constexpr std::array<NamedKey, 19> kNamedKeys = {{{Key::Left, "left", 'h'},
                                                         {Key::Right, "right", 'l'},
                                                         {Key::Up, "up", 'k'},
                                                         {Key::Down, "down", 'j'},
                                                         {Key::SlantLess, "[", '['},
                                                         {Key::SlantMore, "]", ']'},
                                                         {Key::Coarser, "+", '+'},
                                                         {Key::Finer, "-", '-'},
                                                         {Key::Next, "enter", '\r'},
                                                         {Key::Back, "backspace", '\x7f'},
                                                         {Key::Undo, "u", 'u'},
                                                         {Key::Redo, "r", 'r'},
                                                         {Key::Compare, "space", ' '},
                                                         {Key::Restore, "escape", 0},
                                                         {Key::SwapEyes, "i", 'i'},
                                                         {Key::OtherPattern, "f", 'f'},
                                                         {Key::Magnifier, "m", 'm'},
                                                         {Key::Words, "t", 't'},
                                                         {Key::Quit, "q", 'q'}}};

inline constexpr char kEscape = '\x1b';
inline constexpr size_t kLongestSequence = 16;

struct StrideName {
  Stride stride;
  std::string_view prefix;
};
inline constexpr std::array<StrideName, 2> kStrides = {
    {{Stride::Coarse, "shift+"}, {Stride::Fine, "ctrl+"}}};

/// Returns the press of a letter key; the capital letters of the arrows' letters are the coarse
/// strides.
inline std::optional<KeyPress> press_of_byte(char byte) {
  if (byte == '\n') return KeyPress{Key::Next};
  if (byte == '\b') return KeyPress{Key::Back};
  for (const NamedKey& name : kNamedKeys) {
    if (name.byte == 0) continue;
    if (byte == name.byte) return KeyPress{name.key};
    const bool is_letter = name.byte >= 'a' && name.byte <= 'z';
    if (!is_letter || byte != name.byte - 'a' + 'A') continue;
    return KeyPress{name.key, name.key <= Key::Down ? Stride::Coarse : Stride::Normal};
  }
  return std::nullopt;
}

/// Decodes xterm's modifier digit: 2 is shift, 5 is ctrl; other digits are combinations.
inline Stride stride_of_modifier(char digit) {
  if (digit == '2') return Stride::Coarse;
  if (digit == '5') return Stride::Fine;
  return Stride::Normal;
}

/// Decodes the bytes after "escape [" or "escape O", including the last one.
inline std::optional<KeyPress> press_of_sequence(std::string_view body) {
  if (body == "5~") return KeyPress{Key::Up, Stride::Coarse};
  if (body == "6~") return KeyPress{Key::Down, Stride::Coarse};
  const bool has_modifier = body.size() == 4 && body.starts_with("1;");
  if (body.size() != 1 && !has_modifier) return std::nullopt;
  const Stride stride = has_modifier ? stride_of_modifier(body[2]) : Stride::Normal;
  switch (body.back()) {
    case 'A':
      return KeyPress{Key::Up, stride};
    case 'B':
      return KeyPress{Key::Down, stride};
    case 'C':
      return KeyPress{Key::Right, stride};
    case 'D':
      return KeyPress{Key::Left, stride};
    default:
      return std::nullopt;
  }
}

/// Parses one word of a script, without its count.
inline std::optional<KeyPress> press_of_word(std::string_view word) {
  KeyPress press;
  for (const StrideName& stride : kStrides) {
    if (!word.starts_with(stride.prefix)) continue;
    press.stride = stride.stride;
    word.remove_prefix(stride.prefix.size());
  }
  for (const NamedKey& name : kNamedKeys) {
    if (word != name.word) continue;
    press.key = name.key;
    return press;
  }
  return std::nullopt;
}

/// Removes "*12" from the end of the word and returns the number; returns 0 if the number is
/// invalid.
inline int take_count(std::string_view& word) {
  const size_t star = word.find('*');
  if (star == std::string_view::npos) return 1;
  const int count = number_from<int>(word.substr(star + 1)).value_or(0);
  if (count < 1) return 0;
  word = word.substr(0, star);
  return count;
}

/// Returns for example "shift+left".
[[nodiscard]] inline std::string to_string(const KeyPress& press) {
  std::string text;
  for (const StrideName& stride : kStrides)
    if (press.stride == stride.stride) text = stride.prefix;
  for (const NamedKey& name : kNamedKeys)
    if (press.key == name.key) text += name.word;
  return text;
}

/// Parses words as to_string() writes them, separated by spaces or line ends. "left*12" is twelve
/// presses, and the text after a # on a line is a comment. Throws Error(Input) "source:line:
/// cause".
[[nodiscard]] inline std::vector<KeyPress> parse_key_script(std::string_view text,
                                                            const std::string& source) {
  std::vector<KeyPress> presses;
  for (int line = 1; !text.empty(); ++line) {
    std::string_view words = take_until(text, '\n');
    words = words.substr(0, words.find('#'));
    while (!words.empty()) {
      std::string_view word = words.substr(0, words.find_first_of(" \t\r"));
      words.remove_prefix(std::min(word.size() + 1, words.size()));
      if (word.empty()) continue;
      const std::string_view whole = word.substr(0, 40);
      const int count = take_count(word);
      const auto press = press_of_word(word);
      if (count < 1 || !press)
        throw input_error("{}:{}: unknown key '{}'", source, line, whole)
            .remedy("keys are written as left, shift+up, ctrl+right*3, enter, space, escape, u");
      if (static_cast<size_t>(count) + presses.size() > size_t{kMaxScriptPresses})
        throw input_error("{}:{}: more than {} presses", source, line, kMaxScriptPresses);
      presses.insert(presses.end(), static_cast<size_t>(count), *press);
    }
  }
  return presses;
}

/// KeyDecoder turns the bytes of a terminal into key presses. Input is untrusted: unknown bytes and
/// sequences are dropped.
class KeyDecoder {
 public:
  /// Returns the key press that this byte completes, if any.
  [[nodiscard]] std::optional<KeyPress> feed(char byte) {
    if (pending_.empty()) {
      if (byte != kEscape) return press_of_byte(byte);
      pending_ = byte;
      return std::nullopt;
    }
    if (byte ==
        kEscape) {  // the pending escape was a key of its own, or the start of an unknown sequence
      const bool alone = pending_.size() == 1;
      pending_ = byte;
      return alone ? std::optional(KeyPress{Key::Restore}) : std::nullopt;
    }
    pending_ += byte;
    if (pending_.size() == 2) {
      if (byte != '[' && byte != 'O') pending_.clear();  // alt and a letter
      return std::nullopt;
    }
    const bool is_last = byte >= '@' && byte <= '~';
    if (!is_last && pending_.size() < kLongestSequence) return std::nullopt;
    const std::string whole = std::exchange(pending_, {});
    return is_last ? press_of_sequence(std::string_view(whole).substr(2)) : std::nullopt;
  }
  /// Ends a pause in the input: an escape byte without a successor is the escape key itself.
  [[nodiscard]] std::optional<KeyPress> pause() {
    const bool alone = pending_.size() == 1;
    pending_.clear();
    if (alone) return KeyPress{Key::Restore};
    return std::nullopt;
  }
  /// Returns true while the last bytes may still be the start of a longer sequence.
  [[nodiscard]] bool is_waiting() const { return !pending_.empty(); }

 private:
  std::string pending_;  ///< the bytes since the last escape, a few at most
};

}  // namespace lenticule
