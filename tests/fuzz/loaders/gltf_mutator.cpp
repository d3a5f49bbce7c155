// SPDX-License-Identifier: Apache-2.0
// Mutates glTF models so that they stay well-formed: most inputs reach the code behind the JSON
// parser. A mutation changes the JSON document, or bytes of one buffer view (vertices, pictures,
// Draco and meshopt data), or any bytes.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <string>
#include <vector>

extern "C" size_t LLVMFuzzerMutate(uint8_t* data, size_t size, size_t max_size);

namespace {

using Json = nlohmann::json;
using Random = std::minstd_rand;
using Bytes = std::vector<uint8_t>;

constexpr uint32_t kMagic = 0x46546C67;
constexpr uint32_t kJsonChunk = 0x4E4F534A;
constexpr uint32_t kBinaryChunk = 0x004E4942;

/// Model holds a glTF file in parts. A .gltf file has no binary part, and becomes a container.
struct Model {
  Json document;
  Bytes binary;
};

uint32_t number_at(const uint8_t* data) {
  uint32_t value = 0;
  std::memcpy(&value, data, sizeof value);
  return value;
}

void append(Bytes& out, uint32_t value) {
  const size_t at = out.size();
  out.resize(at + sizeof value);
  std::memcpy(out.data() + at, &value, sizeof value);
}

std::optional<Model> read_model(const uint8_t* data, size_t size) {
  Model model;
  if (size >= 20 && number_at(data) == kMagic && number_at(data + 16) == kJsonChunk) {
    const size_t json_size = number_at(data + 12);
    if (json_size > size - 20) return std::nullopt;
    model.document = Json::parse(data + 20, data + 20 + json_size, nullptr, false);
    const size_t binary_at = 20 + json_size + 8;
    if (binary_at <= size) model.binary.assign(data + binary_at, data + size);
  } else {
    model.document = Json::parse(data, data + size, nullptr, false);
  }
  if (!model.document.is_object()) return std::nullopt;
  return model;
}

/// Returns the value as text; a mutated string need not be UTF-8.
std::string text_of(const Json& value) {
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Bytes write_model(const Model& model) {
  std::string json = text_of(model.document);
  json.resize((json.size() + 3) / 4 * 4, ' ');
  Bytes out;
  append(out, kMagic);
  append(out, 2);
  append(out, static_cast<uint32_t>(20 + json.size() + 8 + model.binary.size()));
  append(out, static_cast<uint32_t>(json.size()));
  append(out, kJsonChunk);
  out.insert(out.end(), json.begin(), json.end());
  append(out, static_cast<uint32_t>(model.binary.size()));
  append(out, kBinaryChunk);
  out.insert(out.end(), model.binary.begin(), model.binary.end());
  return out;
}

void collect_values(Json& value, std::vector<Json*>& found) {
  found.push_back(&value);
  if (!value.is_structured()) return;
  for (Json& part : value) collect_values(part, found);
}

/// Returns the number increased by `step`, which wraps around.
Json stepped(const Json& value, int64_t step) {
  return Json(static_cast<int64_t>(static_cast<uint64_t>(value.get<int64_t>()) +
                                   static_cast<uint64_t>(step)));
}

Json mutated_number(const Json& value, Random& random) {
  static const std::array<Json, 17> kExtremes{-1,         0,     1,          2,     3,     4,
                                              5120,       5126,  34963,      255,   256,   65536,
                                              2147483647, 1e-30, 4294967296, 1e300, -1e300};
  switch (random() % 4) {
    case 0:
      return kExtremes[random() % kExtremes.size()];
    case 1:
      return value.is_number_float() ? Json(-value.get<double>()) : stepped(value, 1);
    case 2:
      return value.is_number_float() ? Json(value.get<double>() * 1.5) : stepped(value, -1);
    default:
      return random() % 16;
  }
}

Json mutated_text(const std::string& text, Random& random) {
  static const std::array<const char*, 24> kWords{
      "SCALAR",      "VEC2",     "VEC3",       "VEC4",       "MAT4",      "POSITION",
      "NORMAL",      "TANGENT",  "TEXCOORD_1", "COLOR_0",    "JOINTS_0",  "WEIGHTS_0",
      "translation", "rotation", "scale",      "weights",    "STEP",      "CUBICSPLINE",
      "BLEND",       "MASK",     "image/png",  "image/webp", "TRIANGLES", "EXT_unknown_thing"};
  if (text.empty() || random() % 3 != 0) return kWords[random() % kWords.size()];
  std::string changed = text;
  changed[random() % changed.size()] = static_cast<char>(' ' + random() % 95);
  return changed;
}

/// Removes, copies or exchanges a part of an array or an object.
void mutate_structure(Json& value, const Json& other, Random& random) {
  if (value.empty()) {
    if (value.is_array()) value.push_back(other);
    return;
  }
  auto part = value.begin();
  std::advance(part, random() % value.size());
  switch (random() % 3) {
    case 0:
      value.erase(part);
      return;
    case 1:
      if (value.is_array() && value.size() < 64) value.push_back(Json(*part));
      return;
    default:
      *part = other;
  }
}

void mutate_document(Json& document, Random& random) {
  std::vector<Json*> values;
  collect_values(document, values);
  Json& value = *values[random() % values.size()];
  // A copy: the other value may contain this one.
  const Json other = *values[1 % values.size() + random() % std::max<size_t>(1, values.size() - 1)];
  if (random() % 8 == 0 && &value != &document && text_of(other).size() < 4096) {
    value = other;
  } else if (value.is_number()) {
    value = mutated_number(value, random);
  } else if (value.is_string()) {
    value = mutated_text(value.get<std::string>(), random);
  } else if (value.is_boolean()) {
    value = !value.get<bool>();
  } else if (value.is_structured()) {
    mutate_structure(value, other, random);
  }
}

/// Mutates bytes of one buffer view, whose size stays.
void mutate_view(Model& model, Random& random) {
  size_t begin = 0, size = model.binary.size();
  const Json& views = model.document.value("bufferViews", Json::array());
  if (views.is_array() && !views.empty()) {
    const Json& view = views[random() % views.size()];
    if (view.is_object()) {
      const auto number = [&](const char* key, size_t otherwise) {
        const auto at = view.find(key);
        return at != view.end() && at->is_number_unsigned() ? at->get<size_t>() : otherwise;
      };
      begin = std::min(number("byteOffset", 0), model.binary.size());
      size = std::min(number("byteLength", size), model.binary.size() - begin);
    }
  }
  if (size == 0) return;
  const size_t kept = LLVMFuzzerMutate(model.binary.data() + begin, size, size);
  std::fill_n(model.binary.begin() + static_cast<ptrdiff_t>(begin + kept), size - kept, uint8_t{0});
}

}  // namespace

extern "C" size_t LLVMFuzzerCustomMutator(uint8_t* data, size_t size, size_t max_size,
                                          unsigned int seed) {
  Random random(seed);
  const unsigned kind = random() % 8;
  std::optional<Model> model;
  if (kind != 0) model = read_model(data, size);
  if (!model) return LLVMFuzzerMutate(data, size, max_size);
  if (kind < 5 || model->binary.empty()) {
    for (unsigned changes = 1 + random() % 3; changes > 0; --changes)
      mutate_document(model->document, random);
  } else {
    mutate_view(*model, random);
  }
  const Bytes out = write_model(*model);
  if (out.size() > max_size) return LLVMFuzzerMutate(data, size, max_size);
  std::copy(out.begin(), out.end(), data);
  return out.size();
}
