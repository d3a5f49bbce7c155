// SPDX-License-Identifier: Apache-2.0
// The memory layout of Embree's packet of sixteen rays, for kernels that are compiled once per
// instruction set. Plain data only: nothing here may bring a shared inline function into a file
// that is compiled for AVX-512.
#pragma once

namespace lenticule::render::packet_kernel {

inline constexpr int kLanes = 16;

/// Which of Embree's arrays of sixteen, counted from the beginning of a packet, is which. The same
/// in Embree 3 and 4.
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
