// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/gltf/accessor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "render/loaders/limits.h"

namespace lenticule::render::gltf {
namespace {

struct Type {
  const char* name;
  size_t rows;
  size_t columns;
};
constexpr std::array<Type, 7> kTypes{{{"SCALAR", 1, 1},
                                      {"VEC2", 2, 1},
                                      {"VEC3", 3, 1},
                                      {"VEC4", 4, 1},
                                      {"MAT2", 2, 2},
                                      {"MAT3", 3, 3},
                                      {"MAT4", 4, 4}}};

constexpr size_t kMaxElements = 3 * kMaxTriangles;

Component component_of(const JsonAt& code) {
  switch (code.whole()) {
    case 5120:
      return Component::Int8;
    case 5121:
      return Component::Uint8;
    case 5122:
      return Component::Int16;
    case 5123:
      return Component::Uint16;
    case 5125:
      return Component::Uint32;
    case 5126:
      return Component::Float;
    default:
      code.fail(fmt::format("{} is no component type", code.whole()));
  }
}

size_t bytes_of(Component component) {
  switch (component) {
    case Component::Int8:
    case Component::Uint8:
      return 1;
    case Component::Int16:
    case Component::Uint16:
      return 2;
    case Component::Uint32:
    case Component::Float:
      break;
  }
  return 4;
}

template <class T>
double loaded(const uint8_t* from) {
  T value{};
  std::memcpy(&value, from, sizeof value);
  return static_cast<double>(value);
}

double load(const uint8_t* from, Component component) {
  switch (component) {
    case Component::Int8:
      return loaded<int8_t>(from);
    case Component::Uint8:
      return loaded<uint8_t>(from);
    case Component::Int16:
      return loaded<int16_t>(from);
    case Component::Uint16:
      return loaded<uint16_t>(from);
    case Component::Uint32:
      return loaded<uint32_t>(from);
    case Component::Float:
      break;
  }
  return loaded<float>(from);
}

size_t count_of(const JsonAt& owner, size_t most) {
  const JsonAt count = owner.at("count");
  const uint64_t value = count.whole();
  if (value < 1 || value > most) count.fail(fmt::format("{}, expected 1 to {}", value, most));
  return static_cast<size_t>(value);
}

}  // namespace

double normalized_value(double stored, Component component) {
  switch (component) {
    case Component::Int8:
      return std::max(stored / 127.0, -1.0);
    case Component::Uint8:
      return stored / 255.0;
    case Component::Int16:
      return std::max(stored / 32767.0, -1.0);
    case Component::Uint16:
      return stored / 65535.0;
    case Component::Uint32:
    case Component::Float:
      break;
  }
  return stored;
}

Accessor::Accessor(Document& document, size_t index) : at_(document.list("accessors")[index]) {
  component_ = component_of(at_.at("componentType"));
  normalized_ = at_.flag("normalized", false);
  count_ = count_of(at_, kMaxElements);
  type_ = at_.at("type").text();
  const auto* const type =
      std::ranges::find_if(kTypes, [&](const Type& known) { return type_ == known.name; });
  if (type == kTypes.end()) at_.at("type").fail("unknown");
  components_ = type->rows * type->columns;
  rows_ = type->rows;
  column_bytes_ = type->rows * bytes_of(component_);
  // The columns of a matrix start at multiples of four bytes.
  if (type->columns > 1) column_bytes_ = (column_bytes_ + 3) / 4 * 4;
  element_bytes_ = column_bytes_ * type->columns;
  if (at_.find("bufferView"))
    base_ = elements(document, at_, count_, element_bytes_);
  else
    check_count_of_zeros(document);
  if (const auto sparse = at_.find("sparse")) read_sparse(document, *sparse);
}

/// An accessor without a buffer view has zeros, or the values of compressed data. A small file must
/// not allocate memory for many of them.
void Accessor::check_count_of_zeros(Document& document) const {
  constexpr size_t kMostPerByte = 1024;
  if (count_ / kMostPerByte > document.total_bytes())
    at_.at("count").fail(
        fmt::format("{} elements without a buffer view, the file and its buffers have {} bytes",
                    count_, document.total_bytes()));
}

Accessor::Elements Accessor::elements(Document& document, const JsonAt& owner, size_t count,
                                      size_t element_bytes) const {
  const size_t index =
      owner.at("bufferView").index(document.list("bufferViews").size(), "buffer views");
  const BufferView view = document.view(index);
  const uint64_t offset = owner.whole("byteOffset", 0);
  const size_t stride = view.stride == 0 ? element_bytes : view.stride;
  if (stride < element_bytes)
    owner.at("bufferView")
        .fail(
            fmt::format("byteStride {} is less than an element's {} bytes", stride, element_bytes));
  const uint64_t needed = uint64_t{count - 1} * stride + element_bytes;
  if (offset > view.bytes.size() || needed > view.bytes.size() - offset)
    owner.fail(fmt::format("{} elements need {} bytes from byte {} on, buffer view {} has {}",
                           count, needed, offset, index, view.bytes.size()));
  return {view.bytes.subspan(static_cast<size_t>(offset)), stride};
}

void Accessor::read_sparse(Document& document, const JsonAt& sparse) {
  Sparse replaced;
  replaced.count = count_of(sparse, count_);
  const JsonAt indices = sparse.at("indices");
  replaced.index_component = component_of(indices.at("componentType"));
  if (replaced.index_component == Component::Float) indices.at("componentType").fail("no integers");
  replaced.indices =
      elements(document, indices, replaced.count, bytes_of(replaced.index_component));
  replaced.values = elements(document, sparse.at("values"), replaced.count, element_bytes_);
  for (size_t i = 0; i < replaced.count; ++i) {
    const double index =
        load(replaced.indices.bytes.data() + i * replaced.indices.stride, replaced.index_component);
    if (!(index >= 0.0 && index < static_cast<double>(count_)))
      indices.fail(fmt::format("element {}: {:g} of {} elements", i, index, count_));
  }
  sparse_ = replaced;
}

void Accessor::require(const char* type, size_t count) const {
  if (type_ != type) at_.at("type").fail(fmt::format("{}, expected {}", type_, type));
  if (count != 0 && count != count_)
    at_.at("count").fail(fmt::format("{}, expected {}", count_, count));
}

Element Accessor::element(const Elements& elements, size_t index) const {
  Element values{};
  if (elements.bytes.empty()) return values;
  const uint8_t* const from = elements.bytes.data() + index * elements.stride;
  for (size_t i = 0; i < components_; ++i) {
    const size_t place = i / rows_ * column_bytes_ + i % rows_ * bytes_of(component_);
    const double stored = load(from + place, component_);
    values[i] = normalized_ ? normalized_value(stored, component_) : stored;
  }
  return values;
}

void Accessor::each(const TakeElement& take) const {
  for (size_t i = 0; i < count_; ++i) take(i, element(base_, i));
  if (!sparse_) return;
  for (size_t i = 0; i < sparse_->count; ++i) {
    const double index =
        load(sparse_->indices.bytes.data() + i * sparse_->indices.stride, sparse_->index_component);
    take(static_cast<size_t>(index), element(sparse_->values, i));
  }
}

Accessor accessor_of(Document& document, const JsonAt& index) {
  return {document, index.index(document.list("accessors").size(), "accessors")};
}

}  // namespace lenticule::render::gltf
