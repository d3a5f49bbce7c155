// SPDX-License-Identifier: Apache-2.0
#include "tests/support/gltf_model.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wpedantic"
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#pragma GCC diagnostic pop

#include <meshoptimizer.h>

#include <fstream>
#include <map>
#include <string_view>

#include "base/error.h"

namespace lenticule::test {
namespace {

using nlohmann::json;

const std::vector<float> kPositions{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
const std::vector<float> kNormals{0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
const std::vector<float> kUvs{0, 1, 1, 1, 1, 0, 0, 0};
const std::vector<uint16_t> kIndices{0, 1, 2, 0, 2, 3};

size_t components_of(std::string_view type) {
  if (type == "SCALAR") return 1;
  if (type == "VEC2") return 2;
  if (type == "VEC3") return 3;
  return type == "MAT4" ? 16 : 4;
}

size_t bytes_of_component(ComponentCode component) {
  if (component == kByte || component == kUbyte) return 1;
  return component == kShort || component == kUshort ? 2 : 4;
}

void append_32(ByteVector& to, size_t value) {
  for (int shift = 0; shift < 32; shift += 8)
    to.push_back(static_cast<uint8_t>(value >> shift & 0xFF));
}

void append_chunk(ByteVector& to, std::string_view type, ByteVector data, uint8_t padding) {
  while (data.size() % 4 != 0) data.push_back(padding);
  append_32(to, data.size());
  to.insert(to.end(), type.begin(), type.end());
  to.insert(to.end(), data.begin(), data.end());
}

void add_draco_attribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type, int components,
                         const std::vector<float>& values) {
  draco::GeometryAttribute description;
  description.Init(type, nullptr, static_cast<int8_t>(components), draco::DT_FLOAT32, false,
                   static_cast<int64_t>(sizeof(float)) * components, 0);
  const auto count = static_cast<uint32_t>(values.size()) / static_cast<uint32_t>(components);
  const int id = mesh.AddAttribute(description, true, count);
  for (uint32_t i = 0; i < count; ++i)
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i),
                                          values.data() + i * static_cast<uint32_t>(components));
}

template <class T>
ByteVector bytes_from(const json& values) {
  return bytes_of(values.get<std::vector<T>>());
}

struct Component {
  ComponentCode code;
  ByteVector (*bytes_from)(const json& values);
};

const Component& component(const std::string& name) {
  static const std::map<std::string, Component> components{
      {"byte", {kByte, bytes_from<int8_t>}},    {"ubyte", {kUbyte, bytes_from<uint8_t>}},
      {"short", {kShort, bytes_from<int16_t>}}, {"ushort", {kUshort, bytes_from<uint16_t>}},
      {"uint", {kUint, bytes_from<uint32_t>}},  {"float", {kFloat, bytes_from<float>}}};
  return components.at(name);
}

json resolved(GltfModel& model, const json& value);

int add_accessor(GltfModel& model, json value) {
  const auto type = value.at("accessor").get<std::string>();
  const Component& of = component(value.at("of"));
  int view = value.value("view", -1);
  size_t count = value.value("count", size_t{0});
  if (value.contains("values")) {
    view = model.add_view(of.bytes_from(value["values"]), value.value("stride", 0));
    if (count == 0) count = value["values"].size() / components_of(type);
  }
  for (const char* key : {"accessor", "of", "view", "count", "values", "stride"}) value.erase(key);
  return model.add_accessor_at(view, count, type.c_str(), of.code, resolved(model, value));
}

/// Replaces accessors and buffer views by their numbers.
json resolved(GltfModel& model, const json& value) {
  if (value.is_object() && value.contains("accessor")) return add_accessor(model, value);
  if (value.is_object() && value.value("of", std::string()) == "draco quad")
    return model.add_view(draco_quad());
  if (value.is_object() && value.contains("of"))
    return model.add_view(component(value["of"]).bytes_from(value["values"]));
  if (!value.is_structured()) return value;
  json out = value;
  for (auto& part : out) part = resolved(model, part);
  return out;
}

void set(GltfModel& model, const std::string& path, const json& value) {
  const size_t slash = path.find('/');
  const std::string root = path.substr(0, slash);
  json& from = root == "node"         ? model.node()
               : root == "primitive"  ? model.primitive()
               : root == "attributes" ? model.attributes()
               : root == "material"   ? model.material()
                                      : model.json;
  const json::json_pointer pointer(path.substr(slash));
  if (value.is_null())
    from[pointer.parent_pointer()].erase(pointer.back());
  else
    from[pointer] = value;
}

}  // namespace

GltfModel::GltfModel() {
  json = {{"asset", {{"version", "2.0"}}},
          {"scene", 0},
          {"scenes", {{{"nodes", {0}}}}},
          {"nodes", {{{"mesh", 0}, {"name", "node"}}}},
          {"meshes", nlohmann::json::array()}};
  const int positions = add_accessor(kPositions, "VEC3", kFloat);
  const int normals = add_accessor(kNormals, "VEC3", kFloat);
  const int uvs = add_accessor(kUvs, "VEC2", kFloat);
  const int indices = add_accessor(kIndices, "SCALAR", kUshort);
  json["meshes"].push_back(
      {{"name", "quad"},
       {"primitives",
        {{{"attributes", {{"POSITION", positions}, {"NORMAL", normals}, {"TEXCOORD_0", uvs}}},
          {"indices", indices}}}}});
}

GltfModel::GltfModel(const nlohmann::ordered_json& changes) : GltfModel() {
  for (const auto& [key, change] : changes.items()) {
    const nlohmann::json value = resolved(*this, nlohmann::json::parse(change.dump()));
    if (key == "nodes") {
      for (const nlohmann::json& node : value) add_node(node);
    } else if (key == "textures") {
      for (const nlohmann::json& sampler : value)
        add_texture(sampler.empty() ? nlohmann::json() : sampler);
    } else if (key == "require") {
      for (const nlohmann::json& extension : value) require(extension);
    } else if (key == "use") {
      json["extensionsUsed"] = value;
    } else if (key == "animate") {
      animate(value[0], value[1], value[2], value[3], value[4].get<std::string>().c_str(),
              value[5]);
    } else {
      set(*this, key, value);
    }
  }
}

std::vector<nlohmann::ordered_json> gltf_cases(const std::string& file) {
  std::ifstream in(file);
  return nlohmann::ordered_json::parse(in).get<std::vector<nlohmann::ordered_json>>();
}

nlohmann::json& GltfModel::material() {
  if (!json.contains("materials")) {
    json["materials"] = {{{"name", "material"}}};
    primitive()["material"] = 0;
  }
  return json["materials"][0];
}

int GltfModel::add_view(const ByteVector& bytes, int stride) {
  while (buffer_.size() % 4 != 0) buffer_.push_back(0);
  nlohmann::json view = {
      {"buffer", 0}, {"byteOffset", buffer_.size()}, {"byteLength", bytes.size()}};
  if (stride != 0) view["byteStride"] = stride;
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  json["bufferViews"].push_back(view);
  return static_cast<int>(json["bufferViews"].size()) - 1;
}

int GltfModel::add_accessor_of(int view, size_t bytes, const char* type, ComponentCode component,
                               const nlohmann::json& more) {
  return add_accessor_at(view, bytes / bytes_of_component(component) / components_of(type), type,
                         component, more);
}

int GltfModel::add_accessor_at(int view, size_t count, const char* type, ComponentCode component,
                               const nlohmann::json& more) {
  nlohmann::json accessor = {
      {"componentType", static_cast<int>(component)}, {"count", count}, {"type", type}};
  if (view >= 0) accessor["bufferView"] = view;
  accessor.update(more);
  json["accessors"].push_back(accessor);
  return static_cast<int>(json["accessors"].size()) - 1;
}

int GltfModel::add_texture(const nlohmann::json& sampler) {
  json["images"].push_back({{"bufferView", add_view(small_png())}, {"mimeType", "image/png"}});
  nlohmann::json texture = {{"source", json["images"].size() - 1}};
  if (!sampler.is_null()) {
    json["samplers"].push_back(sampler);
    texture["sampler"] = json["samplers"].size() - 1;
  }
  json["textures"].push_back(texture);
  return static_cast<int>(json["textures"].size()) - 1;
}

int GltfModel::add_node(const nlohmann::json& node) {
  json["nodes"].push_back(node);
  const int index = static_cast<int>(json["nodes"].size()) - 1;
  json["scenes"][0]["nodes"].push_back(index);
  return index;
}

void GltfModel::animate(int node, const std::string& path, const std::vector<float>& times,
                        const std::vector<float>& values, const char* type,
                        const std::string& interpolation) {
  const int input = add_accessor(times, "SCALAR", kFloat);
  const int output = add_accessor(values, type, kFloat);
  if (!json.contains("animations"))
    json["animations"] = {
        {{"channels", nlohmann::json::array()}, {"samplers", nlohmann::json::array()}}};
  nlohmann::json& animation = json["animations"][0];
  animation["samplers"].push_back(
      {{"input", input}, {"output", output}, {"interpolation", interpolation}});
  animation["channels"].push_back({{"sampler", animation["samplers"].size() - 1},
                                   {"target", {{"node", node}, {"path", path}}}});
}

void GltfModel::require(const std::string& extension) {
  json["extensionsUsed"].push_back(extension);
  json["extensionsRequired"].push_back(extension);
}

ByteVector GltfModel::gltf() const {
  nlohmann::json whole = json;
  whole["buffers"] = {{{"byteLength", buffer_.size()},
                       {"uri", "data:application/octet-stream;base64," + base64(buffer_)}}};
  for (const auto& more : json.value("buffers", nlohmann::json::array()))
    whole["buffers"].push_back(more);
  const std::string text = whole.dump();
  return {text.begin(), text.end()};
}

ByteVector GltfModel::glb() const {
  nlohmann::json whole = json;
  whole["buffers"] = {{{"byteLength", buffer_.size()}}};
  for (const auto& more : json.value("buffers", nlohmann::json::array()))
    whole["buffers"].push_back(more);
  const std::string text = whole.dump();
  ByteVector chunks;
  append_chunk(chunks, "JSON", {text.begin(), text.end()}, ' ');
  append_chunk(chunks, std::string_view("BIN\0", 4), buffer_, 0);
  ByteVector file{'g', 'l', 'T', 'F'};
  constexpr size_t kHeaderBytes = 12;
  append_32(file, 2);
  append_32(file, kHeaderBytes + chunks.size());
  file.insert(file.end(), chunks.begin(), chunks.end());
  return file;
}

std::string base64(const ByteVector& bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t bits = 0;
    for (size_t k = 0; k < 3; ++k) bits = bits << 8 | (i + k < bytes.size() ? bytes[i + k] : 0U);
    for (size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? kDigits[bits >> (18 - 6 * k) & 63U] : '=';
  }
  return text;
}

ByteVector draco_quad() {
  draco::Mesh mesh;
  mesh.set_num_points(4);
  add_draco_attribute(mesh, draco::GeometryAttribute::POSITION, 3, kPositions);
  add_draco_attribute(mesh, draco::GeometryAttribute::NORMAL, 3, kNormals);
  add_draco_attribute(mesh, draco::GeometryAttribute::TEX_COORD, 2, kUvs);
  for (size_t i = 0; i < kIndices.size(); i += 3)
    mesh.AddFace({draco::PointIndex(kIndices[i]), draco::PointIndex(kIndices[i + 1]),
                  draco::PointIndex(kIndices[i + 2])});
  draco::Encoder encoder;
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 14);
  draco::EncoderBuffer buffer;
  LENTICULE_CHECK(encoder.EncodeMeshToBuffer(mesh, &buffer).ok());
  return {buffer.data(), buffer.data() + buffer.size()};
}

ByteVector meshopt_vertices(const ByteVector& vertices, size_t stride) {
  const size_t count = vertices.size() / stride;
  ByteVector encoded(meshopt_encodeVertexBufferBound(count, stride));
  encoded.resize(
      meshopt_encodeVertexBuffer(encoded.data(), encoded.size(), vertices.data(), count, stride));
  return encoded;
}

ByteVector meshopt_triangles(const std::vector<uint32_t>& corners, size_t vertices) {
  ByteVector encoded(meshopt_encodeIndexBufferBound(corners.size(), vertices));
  encoded.resize(
      meshopt_encodeIndexBuffer(encoded.data(), encoded.size(), corners.data(), corners.size()));
  return encoded;
}

ByteVector small_png() {
  return {0x89, 0x50, 0x4E, 0x47, 0x0D, 0x0A, 0x1A, 0x0A, 0x00, 0x00, 0x00, 0x0D, 0x49, 0x48, 0x44,
          0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x02, 0x08, 0x06, 0x00, 0x00, 0x00, 0x72,
          0xB6, 0x0D, 0x24, 0x00, 0x00, 0x00, 0x09, 0x6F, 0x46, 0x46, 0x73, 0x00, 0x00, 0x00, 0x00,
          0x00, 0x00, 0x00, 0x00, 0x00, 0xDA, 0x2A, 0xB6, 0xCE, 0x00, 0x00, 0x00, 0x18, 0x49, 0x44,
          0x41, 0x54, 0x08, 0x99, 0x63, 0xF8, 0xCF, 0xC0, 0xF0, 0x1F, 0x04, 0x99, 0x18, 0x19, 0xFE,
          0x37, 0xEE, 0xD9, 0xBB, 0x87, 0x01, 0x00, 0x44, 0x15, 0x07, 0xB5, 0x59, 0xF1, 0xDC, 0xBE,
          0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4E, 0x44, 0xAE, 0x42, 0x60, 0x82};
}

ByteVector small_webp() {
  return {0x52, 0x49, 0x46, 0x46, 0x76, 0x00, 0x00, 0x00, 0x57, 0x45, 0x42, 0x50, 0x56, 0x50,
          0x38, 0x58, 0x0A, 0x00, 0x00, 0x00, 0x10, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x01,
          0x00, 0x00, 0x41, 0x4C, 0x50, 0x48, 0x05, 0x00, 0x00, 0x00, 0x00, 0xFF, 0xFF, 0x80,
          0xFF, 0x00, 0x56, 0x50, 0x38, 0x20, 0x4A, 0x00, 0x00, 0x00, 0xF0, 0x01, 0x00, 0x9D,
          0x01, 0x2A, 0x02, 0x00, 0x02, 0x00, 0x00, 0x00, 0x00, 0x25, 0x00, 0x4E, 0x80, 0xB7,
          0x1D, 0x33, 0x2A, 0xC4, 0x8E, 0xC0, 0x00, 0xFE, 0xFA, 0xE5, 0xFF, 0xF3, 0x0F, 0xDB,
          0x7D, 0x9B, 0xE6, 0x8B, 0xFF, 0x73, 0x67, 0xFF, 0xDF, 0x1B, 0xF1, 0x31, 0xE2, 0x41,
          0xFB, 0xF3, 0x25, 0x8C, 0x3F, 0xE8, 0x05, 0x8F, 0xFE, 0xFF, 0x55, 0xFF, 0xF7, 0xFA,
          0xAF, 0xFF, 0xBF, 0xD5, 0x7F, 0xBB, 0x4D, 0x59, 0x6A, 0x21, 0xBF, 0x00, 0x00, 0x00};
}

}  // namespace lenticule::test
