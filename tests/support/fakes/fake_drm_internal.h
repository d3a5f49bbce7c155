// SPDX-License-Identifier: Apache-2.0
// Declares helpers of the fake's libdrm functions.
#pragma once

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "fake_drm.h"

namespace lenticule::test {

using Faults = std::vector<CallFault> FakeCard::*;

/// Returns the card behind a descriptor; null if it was unplugged.
inline FakeCard* card_of(int fd) {
  FakeCard* card = FakeDrm::instance().card_of(fd);
  return card != nullptr && !card->gone ? card : nullptr;
}

/// Begins every call to a card: returns 0, or the negative errno of a lost card or of a fault
/// planned for this call.
inline int begin_call(FakeCard* card, Faults planned) {
  return card == nullptr ? -ENODEV : -card->fail_with(card->*planned);
}

/// Allocates memory as libdrm does.
template <typename T>
T* zeroed(size_t count = 1) {
  return static_cast<T*>(std::calloc(std::max<size_t>(count, 1), sizeof(T)));
}

template <typename T>
T* copied(const std::vector<T>& values) {
  T* const copy = zeroed<T>(values.size());
  std::copy(values.begin(), values.end(), copy);
  return copy;
}

}  // namespace lenticule::test
