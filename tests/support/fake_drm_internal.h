// SPDX-License-Identifier: Apache-2.0
// What the fake's libdrm functions have in common.
#pragma once

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "fake_drm.h"

namespace lenticule::testing {

using Faults = std::vector<CallFault> FakeCard::*;

/// The card behind a descriptor, unless it was unplugged; null otherwise.
inline FakeCard* card_of(int fd) {
  FakeCard* card = FakeDrm::instance().card_of(fd);
  return card != nullptr && !card->gone ? card : nullptr;
}

/// How every call to a card begins: 0, or the negative errno that it ends with because the card is
/// gone or a fault was planned for this call.
inline int begin_call(FakeCard* card, Faults planned) {
  return card == nullptr ? -ENODEV : -card->fail_with(card->*planned);
}

/// Memory as libdrm hands it out.
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

}  // namespace lenticule::testing
