// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/gltf/meshopt.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

#include <string>

namespace lenticule::render::gltf {
namespace {

/// Decodes without a filter; returns false for damaged data. The decoders require the strides that
/// are checked here.
bool decode(const std::string& mode, std::vector<uint8_t>& to, size_t count, size_t stride,
            std::span<const uint8_t> from, const JsonAt& compression) {
  constexpr size_t kLargestStride = 256;
  if (mode == "ATTRIBUTES") {
    if (stride == 0 || stride % 4 != 0 || stride > kLargestStride)
      compression.at("byteStride").fail(fmt::format("{} is no multiple of 4 up to 256", stride));
    return meshopt_decodeVertexBuffer(to.data(), count, stride, from.data(), from.size()) == 0;
  }
  if (stride != 2 && stride != 4)
    compression.at("byteStride").fail(fmt::format("{}, expected 2 or 4 for indices", stride));
  if (mode == "INDICES")
    return meshopt_decodeIndexSequence(to.data(), count, stride, from.data(), from.size()) == 0;
  if (mode != "TRIANGLES") compression.at("mode").fail("unknown");
  if (count % 3 != 0) compression.at("count").fail(fmt::format("{} is no multiple of 3", count));
  return meshopt_decodeIndexBuffer(to.data(), count, stride, from.data(), from.size()) == 0;
}

void apply_filter(const std::string& filter, std::vector<uint8_t>& data, size_t count,
                  size_t stride, const JsonAt& compression) {
  const auto require_stride = [&](bool good) {
    if (!good) compression.at("filter").fail(fmt::format("{} with stride {}", filter, stride));
  };
  if (filter == "NONE") return;
  if (filter == "OCTAHEDRAL") {
    require_stride(stride == 4 || stride == 8);
    meshopt_decodeFilterOct(data.data(), count, stride);
  } else if (filter == "QUATERNION") {
    require_stride(stride == 8);
    meshopt_decodeFilterQuat(data.data(), count, stride);
  } else if (filter == "EXPONENTIAL") {
    require_stride(stride > 0 && stride % 4 == 0);
    meshopt_decodeFilterExp(data.data(), count, stride);
  } else {
    compression.at("filter").fail("unknown");
  }
}

}  // namespace

std::vector<uint8_t> decode_meshopt(std::span<const uint8_t> bytes, const JsonAt& compression) {
  const uint64_t count = compression.at("count").whole();
  const uint64_t stride = compression.at("byteStride").whole();
  const std::string mode = compression.at("mode").text();
  // No mode shrinks data by more than a factor of 64: a larger count is damaged, and must not
  // allocate memory.
  constexpr uint64_t kMostShrunk = 64;
  constexpr uint64_t kLargestStride = 256;
  const uint64_t most = (bytes.size() + kLargestStride) * kMostShrunk;
  if (stride > kLargestStride || count > most || count * stride > most)
    compression.at("count").fail(fmt::format("{} elements of {} bytes from {} compressed bytes",
                                             count, stride, bytes.size()));
  std::vector<uint8_t> data(static_cast<size_t>(count * stride));
  if (!decode(mode, data, static_cast<size_t>(count), static_cast<size_t>(stride), bytes,
              compression))
    compression.fail("damaged data");
  apply_filter(compression.text("filter", "NONE"), data, static_cast<size_t>(count),
               static_cast<size_t>(stride), compression);
  return data;
}

}  // namespace lenticule::render::gltf
