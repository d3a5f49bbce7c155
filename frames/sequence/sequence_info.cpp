// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/sequence_info.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "frames/sequence/sequence_format.h"

namespace lenticule::frames {
namespace {

using nlohmann::json;

constexpr int kMaxDepth = 8;

[[noreturn]] void fail(const std::string& source, const std::string& key, const std::string& why) {
  throw Error(ErrorKind::Input, fmt::format("{}: metadata: {}: {}", source, key, why),
              "the file is damaged or was not written by lenticule");
}

/// Fields reads the members of one JSON object with checks.
class Fields {
 public:
  Fields(const json& object, std::string source) : object_(object), source_(std::move(source)) {
    if (!object_.is_object()) fail(source_, "document", "not an object");
  }

  [[nodiscard]] const json* find(const char* key) const {
    const auto found = object_.find(key);
    return found == object_.end() || found->is_null() ? nullptr : &*found;
  }
  [[nodiscard]] const json& need(const char* key) const {
    const json* value = find(key);
    if (value == nullptr) fail(source_, key, "missing");
    return *value;
  }
  [[nodiscard]] std::string text(const char* key) const {
    const json* value = find(key);
    if (value == nullptr) return {};
    if (!value->is_string()) fail(source_, key, "not a string");
    return value->get<std::string>();
  }
  [[nodiscard]] uint64_t whole(const char* key, const json& value, uint64_t most) const {
    if (!value.is_number_unsigned() || value.get<uint64_t>() > most)
      fail(source_, key, fmt::format("not a whole number of 0 to {}", most));
    return value.get<uint64_t>();
  }
  [[nodiscard]] uint64_t whole_or(const char* key, uint64_t otherwise, uint64_t most) const {
    const json* value = find(key);
    return value == nullptr ? otherwise : whole(key, *value, most);
  }
  [[nodiscard]] int positive(const char* key, int most) const {
    const auto value = static_cast<int>(whole(key, need(key), static_cast<uint64_t>(most)));
    if (value == 0) fail(source_, key, "zero");
    return value;
  }
  [[nodiscard]] double number_or_zero(const char* key, double most, double least = 0.0) const {
    const json* value = find(key);
    if (value == nullptr) return 0.0;
    if (!value->is_number()) fail(source_, key, "not a number");
    const double number = value->get<double>();
    if (!(number >= least && number <= most))
      fail(source_, key, fmt::format("not in {} to {}", least, most));
    return number;
  }
  [[nodiscard]] const std::string& source() const { return source_; }

 private:
  const json& object_;
  std::string source_;
};

Rate parse_sequence_rate(const Fields& fields) {
  const json& rate = fields.need("rate");
  if (!rate.is_array() || rate.size() != 2) fail(fields.source(), "rate", "not two numbers");
  constexpr uint64_t kMost = 1'000'000'000;
  const auto numerator = static_cast<int64_t>(fields.whole("rate", rate[0], kMost));
  const auto denominator = static_cast<int64_t>(fields.whole("rate", rate[1], kMost));
  try {
    return make_rate(numerator, denominator);
  } catch (const Error& error) {
    fail(fields.source(), "rate", error.what());
  }
}

SequenceViews parse_views(const Fields& all, const FrameGeometry& geometry) {
  const Fields fields(all.need("views"), all.source());
  SequenceViews views;
  views.count = fields.positive("count", kMaxSequenceViews);
  views.columns = fields.positive("columns", kMaxSequenceViews);
  views.rows = fields.positive("rows", kMaxSequenceViews);
  if (static_cast<int64_t>(views.columns) * views.rows < views.count ||
      views.columns > geometry.width || views.rows > geometry.height)
    fail(all.source(), "views", "the grid does not fit the views or the frame");
  const std::string order = fields.text("order");
  if (order != "left-to-right" && order != "right-to-left")
    fail(all.source(), "order", "neither left-to-right nor right-to-left");
  views.rightmost_first = order == "right-to-left";
  views.aspect = fields.number_or_zero("aspect", 1e3);
  views.cone_degrees = fields.number_or_zero("cone_degrees", 180.0);
  views.focus = fields.number_or_zero("focus", 1e9);
  return views;
}

json views_json(const SequenceViews& views) {
  return {{"count", views.count},
          {"columns", views.columns},
          {"rows", views.rows},
          {"order", views.rightmost_first ? "right-to-left" : "left-to-right"},
          {"aspect", views.aspect},
          {"cone_degrees", views.cone_degrees},
          {"focus", views.focus}};
}

void parse_loop(const Fields& fields, SequenceInfo& info) {
  const json* loop = fields.find("loop");
  if (loop == nullptr) return;
  if (!loop->is_array() || loop->size() != 2) fail(fields.source(), "loop", "not two numbers");
  info.loop_begin = fields.whole("loop", (*loop)[0], kMaxSequenceFrames);
  if (!(*loop)[1].is_null()) info.loop_end = fields.whole("loop", (*loop)[1], kMaxSequenceFrames);
  if (info.loop_end && *info.loop_end <= info.loop_begin)
    fail(fields.source(), "loop", "ends before it begins");
}

void parse_rig_trim(const Fields& fields, SequenceInfo& info) {
  info.rig_calibration = fields.text("calibration");
  if (info.rig_calibration.empty()) return;
  constexpr double kOffset = optics::kMaxTrimOffsetLenses, kPitch = optics::kMaxTrimPitch;
  info.rig_trim = {.offset = Lenses(fields.number_or_zero("offset_lenses", kOffset, -kOffset)),
                   .pitch_relative = fields.number_or_zero("pitch_relative", kPitch, -kPitch)};
}

}  // namespace

optics::RigIdentity rig_of(const SequenceInfo& info) {
  return {.fingerprint = info.rig_fingerprint,
          .calibration = info.rig_calibration.empty() ? info.rig_fingerprint : info.rig_calibration,
          .trim = info.rig_trim};
}

void state_rig(SequenceInfo& info, const optics::RigIdentity& rig) {
  info.rig_fingerprint = rig.fingerprint;
  info.rig_calibration = rig.trim.empty() ? std::string() : rig.calibration;
  info.rig_trim = rig.trim;
}

std::string sequence_info_to_json(const SequenceInfo& info) {
  json object = {{"kind", info.kind == SequenceKind::Woven ? "woven" : "views"},
                 {"rate", {info.rate.numerator, info.rate.denominator}},
                 {"first_frame", info.first_frame},
                 {"colour", info.kind == SequenceKind::Woven ? "panel" : "srgb"},
                 {"software", info.software}};
  object["loop"] =
      json::array({json(info.loop_begin), info.loop_end ? json(*info.loop_end) : json(nullptr)});
  if (!info.rig_fingerprint.empty()) object["rig_fingerprint"] = info.rig_fingerprint;
  if (!info.rig_toml.empty()) object["rig_toml"] = info.rig_toml;
  if (!info.rig_calibration.empty())
    object["rig_trim"] = {{"calibration", info.rig_calibration},
                          {"offset_lenses", info.rig_trim.offset.value},
                          {"pitch_relative", info.rig_trim.pitch_relative}};
  if (!info.made_from.empty()) object["made_from"] = info.made_from;
  if (info.views) object["views"] = views_json(*info.views);
  return object.dump(1, ' ', false, json::error_handler_t::replace);
}

SequenceInfo parse_sequence_info(std::string_view text, const FrameGeometry& geometry,
                                 const std::string& source) {
  // Deep nesting takes many times the memory of its text, and valid metadata is not deep.
  const auto shallow = [](int depth, json::parse_event_t, json&) { return depth <= kMaxDepth; };
  const json object = json::parse(text, shallow, false);
  if (object.is_discarded()) fail(source, "document", "not JSON");
  const Fields fields(object, source);
  SequenceInfo info;
  info.geometry = geometry;
  const std::string kind = fields.text("kind");
  if (kind != "woven" && kind != "views") fail(source, "kind", "neither woven nor views");
  info.kind = kind == "woven" ? SequenceKind::Woven : SequenceKind::Views;
  info.rate = parse_sequence_rate(fields);
  info.first_frame = fields.whole_or("first_frame", 0, kMaxFirstFrame);
  parse_loop(fields, info);
  info.rig_fingerprint = fields.text("rig_fingerprint");
  info.rig_toml = fields.text("rig_toml");
  if (const json* trim = fields.find("rig_trim")) parse_rig_trim(Fields(*trim, source), info);
  info.made_from = fields.text("made_from");
  info.software = fields.text("software");
  if (info.kind == SequenceKind::Views) info.views = parse_views(fields, geometry);
  return info;
}

}  // namespace lenticule::frames
