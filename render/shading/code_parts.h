// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lenticule::render {

/// The unit of fine code values: 1 / kCodeParts of an 8-bit code value.
inline constexpr int kCodeParts = 128;

}  // namespace lenticule::render
