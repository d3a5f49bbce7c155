// SPDX-License-Identifier: Apache-2.0
// Document holds a glTF file: its JSON, its buffers and its buffer views, decompressed.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/loaders/gltf/json_at.h"

namespace lenticule::render::gltf {

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

}  // namespace lenticule::render::gltf
