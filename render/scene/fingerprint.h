// SPDX-License-Identifier: Apache-2.0
// Fingerprints compare two sequences of numbers without keeping the numbers.
#pragma once

#include <bit>
#include <cstdint>

namespace lenticule::render {

/// A 128-bit fingerprint: two independent 64-bit hashes of the same words. Equal fingerprints are
/// taken as equal content.
struct Fingerprint {
  uint64_t first = 0;
  uint64_t second = 0;
  friend bool operator==(const Fingerprint&, const Fingerprint&) = default;
};

/// WordMixer computes a Fingerprint from a sequence of words. The order of the words matters.
class WordMixer {
 public:
  void add(uint64_t word) {
    value_.first = std::rotl(value_.first ^ word, 29) * 0x9E3779B97F4A7C15U;
    value_.first ^= value_.first >> 32;
    value_.second = (std::rotl(value_.second, 31) + word) * 0xC2B2AE3D27D4EB4FU;
    value_.second ^= value_.second >> 29;
  }
  void add(double number) { add(std::bit_cast<uint64_t>(number)); }
  void add(float number) { add(uint64_t{std::bit_cast<uint32_t>(number)}); }
  void add(bool flag) { add(uint64_t{flag}); }
  void add(int number) { add(static_cast<uint64_t>(number)); }
  void add(uint32_t number) { add(uint64_t{number}); }

  [[nodiscard]] Fingerprint value() const { return value_; }

 private:
  Fingerprint value_{0x243F6A8885A308D3U, 0x13198A2E03707344U};
};

}  // namespace lenticule::render
