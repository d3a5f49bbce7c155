// SPDX-License-Identifier: Apache-2.0
// DracoMesh decodes the compressed geometry of KHR_draco_mesh_compression.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "render/loaders/gltf/accessor.h"

namespace lenticule::render::gltf {

class DracoMesh {
 public:
  /// `extension` is for messages. Throws Error(Input) for damaged data.
  DracoMesh(Bytes bytes, const JsonAt& extension);
  ~DracoMesh();
  DracoMesh(const DracoMesh&) = delete;
  DracoMesh& operator=(const DracoMesh&) = delete;

  [[nodiscard]] size_t vertices() const;
  /// Returns the corners of all triangles, each less than vertices().
  [[nodiscard]] std::vector<uint32_t> corners() const;
  /// Calls `take` for every vertex with the attribute of a number that the extension assigns. The
  /// accessor states the number of components, and whether integers are normalized.
  void each(const JsonAt& attribute, const Accessor& accessor, const TakeElement& take) const;

 private:
  struct Decoded;
  std::unique_ptr<const Decoded> decoded_;
};

}  // namespace lenticule::render::gltf
