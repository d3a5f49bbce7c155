// SPDX-License-Identifier: Apache-2.0
// Memory layout of Embree's packet of sixteen rays, for kernels that are compiled once per
// instruction set. Plain data only: this header must not bring shared inline functions into a file
// that is compiled for AVX-512.
#pragma once

namespace lenticule::render::packet_kernel {

inline constexpr int kLanes = 16;

/// Indices of Embree's arrays of sixteen elements, counted from the beginning of a packet. They are
/// the same in Embree 3 and 4.
enum Field : int {
  kOriginX,
  kOriginY,
  kOriginZ,
  kTNear,
  kDirectionX,
  kDirectionY,
  kDirectionZ,
  kTime,
  kTFar,
  kMask,
  kId,
  kFlags,
  kNormalX,
  kNormalY,
  kNormalZ,
  kU,
  kV,
  kPrimitive,
  kGeometry,
};

}  // namespace lenticule::render::packet_kernel
