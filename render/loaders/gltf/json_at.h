// SPDX-License-Identifier: Apache-2.0
// JsonAt is a value of a JSON document together with its path, which every error message names:
// "model.glb: accessors[3].bufferView: 12 of 4 buffer views".
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "optics/vec.h"

namespace lenticule::render::gltf {

/// All functions throw Error(Input) with the file and the path of the value that is missing, has
/// another type or is out of range. Lifetime: must not outlive the document and its file name.
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
  /// Returns the names of the members of this object.
  [[nodiscard]] std::vector<std::string> keys() const;

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

  [[nodiscard]] double number(const char* key, double otherwise) const;
  /// Returns a number limited to [low, high].
  [[nodiscard]] double number_within(const char* key, double otherwise, double low,
                                     double high) const;
  [[nodiscard]] uint64_t whole(const char* key, uint64_t otherwise) const;
  [[nodiscard]] std::string text(const char* key, const std::string& otherwise) const;
  [[nodiscard]] bool flag(const char* key, bool otherwise) const;
  [[nodiscard]] std::optional<size_t> find_index(const char* key, size_t count,
                                                 const char* items) const;
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

}  // namespace lenticule::render::gltf
