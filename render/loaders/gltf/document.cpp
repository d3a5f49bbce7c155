// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/gltf/document.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "base/error.h"
#include "base/file.h"
#include "render/loaders/file_names.h"
#include "render/loaders/gltf/meshopt.h"
#include "render/loaders/limits.h"

namespace lenticule::render::gltf {
namespace {

using nlohmann::json;

constexpr int kDeepestJson = 64;

[[noreturn]] void refuse(const std::string& source, const std::string& reason) {
  throw Error(ErrorKind::Input, source + ": " + reason);
}

/// Shortens a message of the JSON parser to its cause, in printable characters.
std::string tidy(std::string_view message) {
  constexpr size_t kLongest = 160;
  if (const size_t bracket = message.find("] "); bracket != std::string_view::npos)
    message.remove_prefix(bracket + 2);
  std::string out;
  for (const char c : message.substr(0, kLongest)) out += c >= ' ' && c < 127 ? c : '?';
  return out;
}

/// Parses JSON of limited depth and size: its values take up to a hundred times the bytes of the
/// file.
json parse_json(Bytes text, const std::string& source) {
  size_t values = 0;
  const auto check = [&](int depth, json::parse_event_t, json&) {
    if (depth > kDeepestJson)
      refuse(source, fmt::format("JSON nested deeper than {} levels", kDeepestJson));
    if (++values > kMaxJsonValues)
      refuse(source, fmt::format("JSON of more than {} values", kMaxJsonValues));
    return true;
  };
  try {
    return json::parse(text.begin(), text.end(), check);
  } catch (const json::exception& failure) {
    refuse(source, "damaged JSON: " + tidy(failure.what()));
  }
}

uint32_t little_endian_32(Bytes bytes, size_t at) {
  return uint32_t{bytes[at]} | uint32_t{bytes[at + 1]} << 8 | uint32_t{bytes[at + 2]} << 16 |
         uint32_t{bytes[at + 3]} << 24;
}

struct Chunks {
  Bytes json;
  std::optional<Bytes> binary;
};

bool is_binary_container(Bytes file) {
  constexpr std::string_view kMagic = "glTF";
  return file.size() >= kMagic.size() && std::equal(kMagic.begin(), kMagic.end(), file.begin());
}

/// Divides a binary container: a header (magic, version, length), then chunks (length, type, data).
Chunks chunks_of(Bytes file, const std::string& source) {
  constexpr size_t kHeaderBytes = 12;
  constexpr size_t kChunkHeaderBytes = 8;
  constexpr uint32_t kJson = 0x4E4F534A;
  constexpr uint32_t kBinary = 0x004E4942;
  if (file.size() < kHeaderBytes) refuse(source, "truncated in its header");
  if (const uint32_t version = little_endian_32(file, 4); version != 2)
    refuse(source, fmt::format("container version {}, expected 2", version));
  const size_t stated = little_endian_32(file, 8);
  if (stated > file.size())
    refuse(source, fmt::format("truncated: {} of {} bytes", file.size(), stated));
  Chunks chunks;
  for (size_t at = kHeaderBytes; stated - std::min(at, stated) >= kChunkHeaderBytes;) {
    const size_t length = little_endian_32(file, at);
    const uint32_t type = little_endian_32(file, at + 4);
    at += kChunkHeaderBytes;
    if (length > stated - at)
      refuse(source, fmt::format("chunk of {} bytes, {} are left", length, stated - at));
    if (type == kJson && chunks.json.empty()) chunks.json = file.subspan(at, length);
    if (type == kBinary && !chunks.binary) chunks.binary = file.subspan(at, length);
    at += length;
  }
  if (chunks.json.empty()) refuse(source, "no JSON chunk");
  return chunks;
}

/// Decodes base64; returns nothing for a character that does not belong to it.
std::optional<std::vector<uint8_t>> base64_decoded(std::string_view text) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::array<int8_t, 256> value_of{};
  value_of.fill(-1);
  for (size_t i = 0; i < kDigits.size(); ++i)
    value_of[static_cast<uint8_t>(kDigits[i])] = static_cast<int8_t>(i);
  while (text.ends_with('=')) text.remove_suffix(1);
  std::vector<uint8_t> bytes;
  bytes.reserve(text.size() * 3 / 4);
  uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    const int value = value_of[static_cast<uint8_t>(c)];
    if (value < 0) return std::nullopt;
    bits = bits << 6 | static_cast<uint32_t>(value);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes.push_back(static_cast<uint8_t>(bits >> count & 0xFFU));
  }
  return bytes;
}

std::vector<uint8_t> data_of(const JsonAt& uri, const std::string& text) {
  const size_t comma = text.find(',');
  if (comma == std::string::npos) uri.fail("data URI without data");
  const std::string_view data = std::string_view(text).substr(comma + 1);
  if (!std::string_view(text).substr(0, comma).ends_with(";base64")) {
    const std::string plain = percent_decoded(std::string(data));
    return {plain.begin(), plain.end()};
  }
  if (auto bytes = base64_decoded(data)) return *std::move(bytes);
  uri.fail("damaged base64 data");
}

/// Returns true for a URI such as "https://..." or "file:...". One letter is a Windows drive.
bool has_scheme(const std::string& uri) {
  const size_t colon = uri.find_first_of(":/?#");
  return colon != std::string::npos && colon > 1 && uri[colon] == ':';
}

}  // namespace

bool is_data_uri(const std::string& uri) {
  return uri.starts_with("data:");
}

Document::Document(std::vector<uint8_t> file, std::string source,
                   std::optional<std::filesystem::path> folder)
    : file_(std::move(file)), source_(std::move(source)), folder_(std::move(folder)) {
  Chunks chunks{file_, std::nullopt};
  if (is_binary_container(file_)) chunks = chunks_of(file_, source_);
  json_ = parse_json(chunks.json, source_);
  binary_chunk_ = chunks.binary;
}

const std::vector<JsonAt>& Document::list(const char* key) {
  const auto [known, added] = lists_.try_emplace(key);
  if (added) known->second = root().list(key);
  return known->second;
}

Bytes Document::keep(std::vector<uint8_t> bytes, const JsonAt& owner) {
  kept_bytes_ += bytes.size();
  if (kept_bytes_ > kMaxBufferBytes)
    owner.fail(fmt::format("the scene's buffers have more than {} bytes", kMaxBufferBytes));
  return kept_.emplace_back(std::move(bytes));
}

std::filesystem::path Document::path_of(const JsonAt& uri) const {
  const std::string text = uri.text();
  if (has_scheme(text)) uri.fail("only files and data URIs are read");
  if (!folder_) uri.fail("other files are not read");
  return named_file(*folder_, text);
}

std::vector<uint8_t> Document::read_uri(const JsonAt& uri) {
  const std::string text = uri.text();
  if (is_data_uri(text)) return data_of(uri, text);
  return read_whole_file(path_of(uri), kMaxSceneFileBytes);
}

Bytes Document::buffer(size_t index) {
  if (const auto known = buffers_.find(index); known != buffers_.end()) return known->second;
  const JsonAt& buffer = list("buffers")[index];
  const uint64_t length = buffer.at("byteLength").whole();
  Bytes bytes;
  if (const auto uri = buffer.find("uri"))
    bytes = keep(read_uri(*uri), buffer);
  else if (index == 0 && binary_chunk_)
    bytes = *binary_chunk_;
  else
    buffer.fail("uri is missing, and there is no binary chunk for it");
  if (length > bytes.size())
    buffer.at("byteLength").fail(fmt::format("{}, but there are {} bytes", length, bytes.size()));
  return buffers_[index] = bytes.first(static_cast<size_t>(length));
}

size_t Document::total_bytes() {
  const std::vector<JsonAt>& buffers = list("buffers");
  for (size_t i = 0; i < buffers.size(); ++i)
    if (buffers[i].find("uri")) static_cast<void>(buffer(i));
  return file_.size() + kept_bytes_;
}

/// Returns the bytes that `buffer`, `byteOffset` and `byteLength` of an object state.
Bytes Document::part_of_buffer(const JsonAt& part) {
  const Bytes whole = buffer(part.at("buffer").index(list("buffers").size(), "buffers"));
  const uint64_t offset = part.whole("byteOffset", 0);
  const uint64_t length = part.at("byteLength").whole();
  if (offset > whole.size() || length > whole.size() - offset)
    part.fail(fmt::format("{} bytes from byte {} on exceed the buffer's {} bytes", length, offset,
                          whole.size()));
  return whole.subspan(static_cast<size_t>(offset), static_cast<size_t>(length));
}

Bytes Document::decompressed(size_t index, const JsonAt& compression) {
  if (const auto known = decompressed_.find(index); known != decompressed_.end())
    return known->second;
  const Bytes bytes = part_of_buffer(compression);
  return decompressed_[index] = keep(decode_meshopt(bytes, compression), compression);
}

BufferView Document::view(size_t index) {
  const JsonAt& view = list("bufferViews")[index];
  if (const auto compression = view.extension("EXT_meshopt_compression"))
    return {decompressed(index, *compression),
            static_cast<size_t>(compression->at("byteStride").whole())};
  constexpr uint64_t kLargestStride = 252;
  const uint64_t stride = view.whole("byteStride", 0);
  if (stride > kLargestStride)
    view.at("byteStride").fail(fmt::format("{}, at most {}", stride, kLargestStride));
  return {part_of_buffer(view), static_cast<size_t>(stride)};
}

}  // namespace lenticule::render::gltf
