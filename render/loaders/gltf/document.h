// SPDX-License-Identifier: Apache-2.0
// Document holds a glTF file: its JSON, its buffers and its buffer views, decompressed. Accessor
// reads the typed elements of a glTF accessor.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "optics/vec.h"

namespace lenticule::render::gltf {

/// JsonAt is a value of a JSON document together with its path, which every error message names:
/// "model.glb: accessors[3].bufferView: 12 of 4 buffer views". All functions throw Error(Input) for
/// a value that is missing, has another type or is out of range. Lifetime: must not outlive the
/// document and its file name.
class JsonAt {
 public:
  /// Refers to the root of a document.
  JsonAt(const nlohmann::json& root, const std::string& file) : value_(&root), file_(&file) {}

  /// Returns a member of this object, or nothing if it is absent.
  [[nodiscard]] std::optional<JsonAt> find(const char* key) const;
  /// Returns a member that must be there.
  [[nodiscard]] JsonAt at(const char* key) const;
  /// Returns the object of an extension, or nothing if it is absent.
  [[nodiscard]] std::optional<JsonAt> extension(const char* name) const;

  /// Returns the number of elements of this array.
  [[nodiscard]] size_t size() const;
  [[nodiscard]] JsonAt operator[](size_t index) const;
  /// Returns the elements of an array; none if the member is absent.
  [[nodiscard]] std::vector<JsonAt> list(const char* key) const;

  [[nodiscard]] double number() const;
  [[nodiscard]] uint64_t whole() const;
  [[nodiscard]] std::string text() const;
  /// Returns this whole number if it is less than `count`, the number of `items`.
  [[nodiscard]] size_t index(size_t count, const char* items) const;

  [[nodiscard]] double number(const char* key, double otherwise) const {
    const auto member = find(key);
    return member ? member->number() : otherwise;
  }
  /// Returns a number limited to [low, high].
  [[nodiscard]] double number_within(const char* key, double otherwise, double low,
                                     double high) const {
    return std::clamp(number(key, otherwise), low, high);
  }
  [[nodiscard]] uint64_t whole(const char* key, uint64_t otherwise) const {
    const auto member = find(key);
    return member ? member->whole() : otherwise;
  }
  [[nodiscard]] std::string text(const char* key, const std::string& otherwise) const {
    const auto member = find(key);
    return member ? member->text() : otherwise;
  }
  [[nodiscard]] bool flag(const char* key, bool otherwise) const;
  [[nodiscard]] std::optional<size_t> find_index(const char* key, size_t count,
                                                 const char* items) const {
    const auto member = find(key);
    return member ? std::optional(member->index(count, items)) : std::nullopt;
  }
  /// Returns an array of exactly `count` numbers, or nothing if it is absent.
  [[nodiscard]] std::optional<std::vector<double>> numbers(const char* key, size_t count) const;
  [[nodiscard]] Vec3 vector(const char* key, Vec3 otherwise) const;

  [[noreturn]] void fail(const std::string& reason) const;
  /// Returns the path without the file, for example "accessors[3].bufferView".
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  JsonAt(const nlohmann::json& value, const std::string& file, std::string path)
      : value_(&value), file_(&file), path_(std::move(path)) {}

  const nlohmann::json* value_;
  const std::string* file_;
  std::string path_;
};

using Bytes = std::span<const uint8_t>;

struct BufferView {
  Bytes bytes;
  size_t stride = 0;  ///< 0: elements follow each other without gaps
};

/// All functions throw Error(Input) with the file and the path of the JSON value. Lifetime: spans
/// point into the document.
class Document {
 public:
  /// Reads JSON (.gltf) or a binary container (.glb), whichever `file` is. Without a folder, URIs
  /// of other files are refused.
  Document(std::vector<uint8_t> file, std::string source,
           std::optional<std::filesystem::path> folder);
  Document(const Document&) = delete;
  Document& operator=(const Document&) = delete;

  [[nodiscard]] JsonAt root() const { return {json_, source_}; }
  [[nodiscard]] const std::string& source() const { return source_; }
  /// Returns the elements of a top-level array, such as "nodes"; each is read once.
  [[nodiscard]] const std::vector<JsonAt>& list(const char* key);

  /// Returns the elements of bufferViews[index], decompressed if EXT_meshopt_compression says so.
  [[nodiscard]] BufferView view(size_t index);
  /// Returns the number of bytes of the file and of all its buffers.
  [[nodiscard]] size_t total_bytes();
  /// Returns the bytes of a URI that is not a picture's: a data URI or a file beside the scene.
  [[nodiscard]] std::vector<uint8_t> read_uri(const JsonAt& uri);
  /// Returns the path of the file that a URI names.
  [[nodiscard]] std::filesystem::path path_of(const JsonAt& uri) const;

 private:
  [[nodiscard]] Bytes buffer(size_t index);
  [[nodiscard]] Bytes part_of_buffer(const JsonAt& part);
  [[nodiscard]] Bytes decompressed(size_t index, const JsonAt& compression);
  Bytes keep(std::vector<uint8_t> bytes, const JsonAt& owner);

  std::vector<uint8_t> file_;
  std::string source_;
  std::optional<std::filesystem::path> folder_;
  nlohmann::json json_;
  std::optional<Bytes> binary_chunk_;
  std::map<std::string, std::vector<JsonAt>> lists_;
  std::map<size_t, Bytes> buffers_;
  std::map<size_t, Bytes> decompressed_;
  std::vector<std::vector<uint8_t>> kept_;
  size_t kept_bytes_ = 0;
};

/// Returns true for "data:..." URIs.
[[nodiscard]] bool is_data_uri(const std::string& uri);

/// Values of one element, column by column for matrices.
using Element = std::array<double, 16>;
using TakeElement = std::function<void(size_t index, const Element& values)>;

/// Component is a type of stored numbers.
struct Component {
  uint64_t code;  ///< its number in the file
  size_t bytes;
  double (*load)(const uint8_t* from);
  double full_scale;  ///< stored integer that stands for 1 if it is normalized; 0: none does
  bool is_unsigned;

  /// Returns the number in [-1, 1] or [0, 1] that a stored integer stands for.
  [[nodiscard]] double normalized(double stored) const {
    return full_scale > 0.0 ? std::max(stored / full_scale, -1.0) : stored;
  }
};

/// Accessor holds the checked properties of accessors[index]: all its elements lie inside their
/// buffer views. Lifetime: must not outlive the document.
class Accessor {
 public:
  /// Throws Error(Input) with the JSON path for every property that is out of range.
  Accessor(Document& document, size_t index);

  [[nodiscard]] size_t count() const { return count_; }
  [[nodiscard]] size_t components() const { return components_; }
  [[nodiscard]] const Component& component() const { return *component_; }
  [[nodiscard]] bool is_normalized() const { return normalized_; }
  [[nodiscard]] const JsonAt& at() const { return at_; }
  /// Throws unless the accessor has this type ("VEC3") and, if not 0, this number of elements.
  void require(const char* type, size_t count = 0) const;

  /// Calls `take` for every element, in order; elements of a sparse accessor come twice, the second
  /// time with the value that counts.
  void each(const TakeElement& take) const;

 private:
  /// Elements in memory; without bytes they are zeros.
  struct Elements {
    Bytes bytes;
    size_t stride = 0;
  };
  struct Sparse {
    size_t count = 0;
    Elements indices;
    const Component* index = nullptr;  ///< type of the indices
    Elements values;
    [[nodiscard]] double place(size_t i) const {
      return index->load(indices.bytes.data() + i * indices.stride);
    }
  };

  [[nodiscard]] Elements elements(Document& document, const JsonAt& owner, size_t count,
                                  size_t element_bytes) const;
  void check_count_of_zeros(Document& document) const;
  void read_sparse(Document& document, const JsonAt& sparse);
  void read(const Elements& elements, size_t index, Element& to) const;

  JsonAt at_;
  std::string type_;
  const Component* component_;
  bool normalized_ = false;
  size_t count_ = 0;
  size_t components_ = 1;
  size_t element_bytes_ = 4;
  Elements base_;
  std::optional<Sparse> sparse_;
};

/// Reads the accessor that a JSON value names.
[[nodiscard]] Accessor accessor_of(Document& document, const JsonAt& index);

}  // namespace lenticule::render::gltf
