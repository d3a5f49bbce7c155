// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/gltf/draco_mesh.h"

// The headers of the library convert between integers of different size.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wpedantic"
#include <draco/compression/decode.h>
#pragma GCC diagnostic pop

#include <fmt/format.h>

#include "render/loaders/limits.h"

namespace lenticule::render::gltf {

struct DracoMesh::Decoded {
  std::unique_ptr<const draco::Mesh> mesh;
};

namespace {

/// Takes a number of seven bits per byte from the front of the data.
uint64_t take_varint(Bytes& bytes) {
  uint64_t value = 0;
  for (int shift = 0; shift < 63 && !bytes.empty(); shift += 7) {
    const uint8_t byte = bytes.front();
    bytes = bytes.subspan(1);
    value |= uint64_t{byte & 0x7FU} << shift;
    if ((byte & 0x80U) == 0) break;
  }
  return value;
}

/// Refuses numbers of faces and vertices that so little data cannot hold: the decoder allocates
/// memory for them. The header is "DRACO", version (2 bytes), kind, method, flags (2 bytes); then
/// come the numbers, after the kind of traversal for method 1 (edgebreaker).
void check_header(Bytes bytes, const JsonAt& extension) {
  constexpr size_t kHeaderBytes = 11;
  constexpr size_t kMethodAt = 8;
  constexpr uint8_t kMetadata = 0x80;  // in the second byte of the flags
  constexpr uint64_t kMostPerByte = 1024;
  const uint64_t most = kMostPerByte * bytes.size();
  if (bytes.size() <= kHeaderBytes + 1 || (bytes[kHeaderBytes - 1] & kMetadata) != 0) return;
  Bytes numbers = bytes.subspan(kHeaderBytes + (bytes[kMethodAt] == 1 ? 1 : 0));
  const uint64_t first = take_varint(numbers);
  const uint64_t second = take_varint(numbers);
  if (first > most || second > most)
    extension.fail(fmt::format("{} and {} faces and vertices in {} bytes of Draco data", first,
                               second, bytes.size()));
}

}  // namespace

DracoMesh::DracoMesh(Bytes bytes, const JsonAt& extension) {
  check_header(bytes, extension);
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  auto result = draco::Decoder().DecodeMeshFromBuffer(&buffer);
  if (!result.ok()) extension.fail("damaged Draco data");
  auto decoded = std::make_unique<Decoded>();
  decoded->mesh = std::move(result).value();
  if (decoded->mesh->num_points() > kMaxVertices || decoded->mesh->num_faces() > kMaxTriangles)
    extension.fail(
        fmt::format("more than {} triangles or {} vertices", kMaxTriangles, kMaxVertices));
  decoded_ = std::move(decoded);
}

DracoMesh::~DracoMesh() = default;

size_t DracoMesh::vertices() const {
  return decoded_->mesh->num_points();
}

std::vector<uint32_t> DracoMesh::corners() const {
  const draco::Mesh& mesh = *decoded_->mesh;
  std::vector<uint32_t> corners;
  corners.reserve(size_t{3} * mesh.num_faces());
  for (uint32_t face = 0; face < mesh.num_faces(); ++face)
    for (const draco::PointIndex& point : mesh.face(draco::FaceIndex(face)))
      corners.push_back(point.value());
  return corners;
}

void DracoMesh::each(const JsonAt& attribute, const Accessor& accessor,
                     const TakeElement& take) const {
  const uint64_t number = attribute.whole();
  const draco::PointAttribute* const values =
      number <= UINT32_MAX ? decoded_->mesh->GetAttributeByUniqueId(static_cast<uint32_t>(number))
                           : nullptr;
  if (values == nullptr)
    attribute.fail(fmt::format("{} is no attribute of the compressed mesh", number));
  const bool normalizes = accessor.is_normalized() && !values->normalized();
  const auto components = static_cast<int8_t>(accessor.components());
  for (uint32_t i = 0; i < decoded_->mesh->num_points(); ++i) {
    const draco::AttributeValueIndex place = values->mapped_index(draco::PointIndex(i));
    Element element{};
    if (place.value() >= values->size() ||
        !values->ConvertValue<double>(place, components, element.data()))
      attribute.fail("damaged Draco data");
    if (normalizes)
      for (double& value : element) value = normalized_value(value, accessor.component());
    take(i, element);
  }
}

}  // namespace lenticule::render::gltf
