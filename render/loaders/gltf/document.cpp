// SPDX-License-Identifier: Apache-2.0
// A glTF file is JSON that names buffers, views (parts of buffers) and accessors (typed elements of
// a view). Buffers lie in the binary chunk of a .glb, in other files or in data URIs; views may be
// compressed by meshoptimizer. Every count and offset comes from the file, so each is compared with
// the bytes that are there before memory is allocated for it.
#include "render/loaders/gltf/document.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

#include <cmath>
#include <limits>
#include <string_view>
#include <type_traits>

#include "base/error_kinds.h"
#include "base/text.h"
#include "render/loaders/formats.h"
#include "render/loaders/text_reader.h"
#include "render/loaders/textures.h"

namespace lenticule::render::gltf {

// ---- JSON

std::optional<JsonAt> JsonAt::find(const char* key) const {
  if (!value_->is_object()) fail("not an object");
  const auto member = value_->find(key);
  if (member == value_->end()) return std::nullopt;
  return JsonAt(*member, *file_, path_.empty() ? key : path_ + "." + key);
}

JsonAt JsonAt::at(const char* key) const {
  if (auto member = find(key)) return *member;
  fail(fmt::format("{} is missing", key));
}

std::optional<JsonAt> JsonAt::extension(const char* name) const {
  const auto extensions = find("extensions");
  return extensions ? extensions->find(name) : std::nullopt;
}

size_t JsonAt::size() const {
  if (!value_->is_array()) fail("not an array");
  return value_->size();
}

JsonAt JsonAt::operator[](size_t index) const {
  if (index >= size()) fail(fmt::format("{} of {} elements", index, size()));
  return {(*value_)[index], *file_, fmt::format("{}[{}]", path_, index)};
}

std::vector<JsonAt> JsonAt::list(const char* key) const {
  std::vector<JsonAt> elements;
  const auto array = find(key);
  const size_t count = array ? array->size() : 0;
  elements.reserve(count);
  for (size_t i = 0; i < count; ++i) elements.push_back((*array)[i]);
  return elements;
}

double JsonAt::number() const {
  if (!value_->is_number()) fail("not a number");
  const double value = value_->get<double>();
  if (!std::isfinite(value)) fail("not a finite number");
  return value;
}

uint64_t JsonAt::whole() const {
  if (value_->is_number_unsigned()) return value_->get<uint64_t>();
  constexpr double kLargestExact = 9007199254740992.0;  // 2^53
  const double value = number();
  if (!(value >= 0.0 && value <= kLargestExact) || value != std::floor(value))
    fail(fmt::format("{:g} is no count, offset or index", value));
  return static_cast<uint64_t>(value);
}

std::string JsonAt::text() const {
  if (!value_->is_string()) fail("not a string");
  return value_->get<std::string>();
}

size_t JsonAt::index(size_t count, const char* items) const {
  const uint64_t value = whole();
  if (value >= count) fail(fmt::format("{} of {} {}", value, count, items));
  return static_cast<size_t>(value);
}

bool JsonAt::flag(const char* key, bool otherwise) const {
  const auto member = find(key);
  if (!member) return otherwise;
  if (!member->value_->is_boolean()) member->fail("neither true nor false");
  return member->value_->get<bool>();
}

std::optional<std::vector<double>> JsonAt::numbers(const char* key, size_t count) const {
  const auto member = find(key);
  if (!member) return std::nullopt;
  if (member->size() != count)
    member->fail(fmt::format("{} numbers, expected {}", member->size(), count));
  std::vector<double> values;
  for (size_t i = 0; i < count; ++i) values.push_back((*member)[i].number());
  return values;
}

Vec3 JsonAt::vector(const char* key, Vec3 otherwise) const {
  const auto values = numbers(key, 3);
  return values ? Vec3{(*values)[0], (*values)[1], (*values)[2]} : otherwise;
}

void JsonAt::fail(const std::string& reason) const {
  const std::string place = path_.empty() ? *file_ : *file_ + ": " + path_;
  throw input_error("{}: {}", place, reason);
}

// ---- buffer views of EXT_meshopt_compression

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

/// Decodes `bytes` as the extension's object states. Throws Error(Input) for invalid properties and
/// damaged data.
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

using nlohmann::json;

constexpr int kDeepestJson = 64;

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
  const auto word = [&](size_t at) { return number_at<uint32_t>(file.data() + at); };
  if (const uint32_t version = word(4); version != 2)
    refuse(source, fmt::format("container version {}, expected 2", version));
  const size_t stated = word(8);
  if (stated > file.size())
    refuse(source, fmt::format("truncated: {} of {} bytes", file.size(), stated));
  Chunks chunks;
  for (size_t at = kHeaderBytes; stated - std::min(at, stated) >= kChunkHeaderBytes;) {
    const size_t length = word(at);
    const uint32_t type = word(at + 4);
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

/// Decodes base64, also of several lines; returns nothing for a character that does not belong to
/// it.
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
    if (c == '\n' || c == '\r' || c == ' ' || c == '\t') continue;
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
    const std::string plain = percent_decoded(data);
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

/// Type of elements. The columns of MAT2 and MAT3 may have gaps, but nothing reads those two.
struct Type {
  const char* name;
  size_t components;
};
constexpr std::array<Type, 7> kTypes{
    {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}}};

constexpr size_t kMaxElements = 3 * kMaxTriangles;

template <class T>
constexpr Component component(uint64_t code) {
  return {.code = code,
          .bytes = sizeof(T),
          .load = [](const uint8_t* from) { return static_cast<double>(number_at<T>(from)); },
          .full_scale = sizeof(T) < 4 ? double{std::numeric_limits<T>::max()} : 0.0,
          .is_unsigned = std::is_unsigned_v<T>};
}
constexpr std::array kComponents{component<int8_t>(5120),   component<uint8_t>(5121),
                                 component<int16_t>(5122),  component<uint16_t>(5123),
                                 component<uint32_t>(5125), component<float>(5126)};

const Component& component_of(const JsonAt& code) {
  const auto* const known = std::ranges::find(kComponents, code.whole(), &Component::code);
  if (known == kComponents.end()) code.fail(fmt::format("{} is no component type", code.whole()));
  return *known;
}

size_t count_of(const JsonAt& owner, size_t most) {
  const JsonAt count = owner.at("count");
  const uint64_t value = count.whole();
  if (value < 1 || value > most) count.fail(fmt::format("{}, expected 1 to {}", value, most));
  return static_cast<size_t>(value);
}

}  // namespace

bool is_data_uri(const std::string& uri) { return uri.starts_with("data:"); }

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
  const std::filesystem::path file = path_of(uri);
  try {
    return read_scene_file(file);
  } catch (const Error& error) {
    throw Error(error.kind(), fmt::format("{}: {}", source_, error.what()),
                "copy the model with all files that it names");
  }
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

// ---- accessors

Accessor::Accessor(Document& document, size_t index)
    : at_(document.list("accessors")[index]), component_(&component_of(at_.at("componentType"))) {
  normalized_ = at_.flag("normalized", false);
  count_ = count_of(at_, kMaxElements);
  type_ = at_.at("type").text();
  const auto* const type =
      std::ranges::find_if(kTypes, [&](const Type& known) { return type_ == known.name; });
  if (type == kTypes.end()) at_.at("type").fail("unknown");
  components_ = type->components;
  element_bytes_ = components_ * component_->bytes;
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
  replaced.index = &component_of(indices.at("componentType"));
  if (replaced.index == &kComponents.back())
    indices.at("componentType").fail("the type of indices is float; expected integers");
  replaced.indices = elements(document, indices, replaced.count, replaced.index->bytes);
  replaced.values = elements(document, sparse.at("values"), replaced.count, element_bytes_);
  for (size_t i = 0; i < replaced.count; ++i) {
    const double index = replaced.place(i);
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

void Accessor::read(const Elements& elements, size_t index, Element& to) const {
  if (elements.bytes.empty()) return;
  const uint8_t* from = elements.bytes.data() + index * elements.stride;
  for (size_t n = 0; n < components_; ++n, from += component_->bytes) {
    const double stored = component_->load(from);
    to[n] = normalized_ ? component_->normalized(stored) : stored;
  }
}

void Accessor::each(const TakeElement& take) const {
  Element values{};
  for (size_t i = 0; i < count_; ++i) {
    read(base_, i, values);
    take(i, values);
  }
  if (!sparse_) return;
  for (size_t i = 0; i < sparse_->count; ++i) {
    read(sparse_->values, i, values);
    take(static_cast<size_t>(sparse_->place(i)), values);
  }
}

Accessor accessor_of(Document& document, const JsonAt& index) {
  return {document, index.index(document.list("accessors").size(), "accessors")};
}

}  // namespace lenticule::render::gltf
