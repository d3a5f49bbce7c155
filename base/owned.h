// SPDX-License-Identifier: Apache-2.0
// Owned owns an object of a C library, which a function of the library releases.
#pragma once

#include <memory>

namespace lenticule {

template <auto kRelease>
struct ReleasedBy {
  void operator()(auto* object) const noexcept { (void)kRelease(object); }
};
template <class Object, auto kRelease>
using Owned = std::unique_ptr<Object, ReleasedBy<kRelease>>;

}  // namespace lenticule
