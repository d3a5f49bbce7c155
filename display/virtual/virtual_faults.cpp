// SPDX-License-Identifier: Apache-2.0
#include "display/virtual/virtual_faults.h"

namespace lenticule::display {
namespace {

// Returns one round of the SplitMix64 generator: a random number per vblank, independent of the
// order of requests.
uint64_t scramble(uint64_t value) noexcept {
  value += 0x9E3779B97F4A7C15u;
  value = (value ^ value >> 30) * 0xBF58476D1CE4E5B9u;
  value = (value ^ value >> 27) * 0x94D049BB133111EBu;
  return value ^ value >> 31;
}

}  // namespace

Nanoseconds UniformJitter::event_delay(uint64_t sequence) noexcept {
  const auto choices = static_cast<uint64_t>(most_.count()) + 1;
  return Nanoseconds(static_cast<int64_t>(scramble(seed_ ^ scramble(sequence)) % choices));
}

}  // namespace lenticule::display
