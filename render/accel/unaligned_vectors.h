// SPDX-License-Identifier: Apache-2.0
// Vectors in memory of any alignment, for kernels that are compiled once per instruction set.
#pragma once

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

/// A vector `v` that may lie at any address, in an array of any type. Compilers drop `aligned` and
/// `may_alias` from the type of a vector where it becomes a reference or a template's argument, but
/// not from a member.
template <class Vector>
struct __attribute__((packed, may_alias)) Unaligned {
  Vector v;
};

}  // namespace
}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
