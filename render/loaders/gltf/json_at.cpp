// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/gltf/json_at.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace lenticule::render::gltf {

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

std::vector<std::string> JsonAt::keys() const {
  if (!value_->is_object()) fail("not an object");
  std::vector<std::string> names;
  for (auto member = value_->begin(); member != value_->end(); ++member)
    names.push_back(member.key());
  return names;
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

double JsonAt::number(const char* key, double otherwise) const {
  const auto member = find(key);
  return member ? member->number() : otherwise;
}

double JsonAt::number_within(const char* key, double otherwise, double low, double high) const {
  return std::clamp(number(key, otherwise), low, high);
}

uint64_t JsonAt::whole(const char* key, uint64_t otherwise) const {
  const auto member = find(key);
  return member ? member->whole() : otherwise;
}

std::string JsonAt::text(const char* key, const std::string& otherwise) const {
  const auto member = find(key);
  return member ? member->text() : otherwise;
}

bool JsonAt::flag(const char* key, bool otherwise) const {
  const auto member = find(key);
  if (!member) return otherwise;
  if (!member->value_->is_boolean()) member->fail("neither true nor false");
  return member->value_->get<bool>();
}

std::optional<size_t> JsonAt::find_index(const char* key, size_t count, const char* items) const {
  const auto member = find(key);
  if (!member) return std::nullopt;
  return member->index(count, items);
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
  throw Error(ErrorKind::Input, place + ": " + reason);
}

}  // namespace lenticule::render::gltf
