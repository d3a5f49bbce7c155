// SPDX-License-Identifier: Apache-2.0
#include "player/control/control_protocol.h"

#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "player/playback/playback_options.h"

namespace lenticule::player {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

struct VerbRow {
  const char* name;
  std::vector<std::string> fields;
  const char* needed = nullptr;  ///< field without which the verb is refused
};

const std::vector<VerbRow>& verbs() {
  static const std::vector<VerbRow> table = {
      {"status", {}},
      {"load", {"source", "item", "frame"}, "source"},
      {"interrupt", {"source", "item", "frame", "seconds"}},
      {"back", {}},
      {"blank", {}},
      {"cue", {"source", "item", "frame", "then_back"}},
      {"go", {}},
      {"play", {}},
      {"pause", {}},
      {"seek", {"frame", "item"}},
      {"next", {}},
      {"previous", {}},
      {"loop", {"count"}, "count"},
      {"speed", {"factor"}, "factor"},
      {"power", {"to"}, "to"},
      {"volume", {"db"}, "db"},
      {"overlay", {"picture", "text", "clock", "code", "at", "height", "for_s", "off"}},
      {"trim", {"offset", "pitch", "offset_by", "pitch_by"}},
      {"rig", {"toml"}, "toml"},
      {"snapshot", {"file", "eye", "panel"}, "file"},
      {"frame", {}},
      {"list", {"item"}},
      {"stats", {}},
      {"doctor", {}},
      {"subscribe", {}},
      {"quit", {}},
  };
  return table;
}

constexpr size_t kMaxIdBytes = 64;
constexpr size_t kMaxTextBytes = 4096;
constexpr uint64_t kMaxCount = 1'000'000'000;
constexpr double kMaxSeconds = 1e6;
constexpr double kLeastSpeed = 0.1;
constexpr double kMostSpeed = 8.0;

[[noreturn]] void refuse(const std::string& what, const std::string& remedy = {}) {
  throw Error(ErrorKind::Usage, what, remedy);
}

bool is_id(const json& id) {
  return id.is_null() || id.is_number_integer() ||
         (id.is_string() && id.get_ref<const std::string&>().size() <= kMaxIdBytes);
}

uint64_t whole(const std::string& field, const json& value) {
  if (value.is_number_unsigned() && value.get<uint64_t>() <= kMaxCount)
    return value.get<uint64_t>();
  refuse(fmt::format("{}: not a whole number of 0 or more", field));
}

double real(const std::string& field, const json& value) {
  if (value.is_number() && std::isfinite(value.get<double>())) return value.get<double>();
  refuse(fmt::format("{}: not a number", field));
}

std::string words(const std::string& field, const json& value, size_t most = kMaxTextBytes) {
  if (!value.is_string()) refuse(fmt::format("{}: not a string", field));
  const auto& text = value.get_ref<const std::string&>();
  if (!text.empty() && text.size() <= most && text.find('\0') == std::string::npos) return text;
  refuse(fmt::format("{}: empty, or longer than {} bytes", field, most));
}

uint64_t count_of_loops(const json& value) {
  if (value == "forever") return 0;
  const uint64_t loops = value.is_number_unsigned() ? whole("count", value) : 0;
  if (loops > 0) return loops;
  refuse("count: not a number of loops", "a number of 1 or more, or \"forever\"");
}

std::array<double, 3> eye(const json& value) {
  if (!value.is_array() || value.size() != 3)
    refuse("eye: not three numbers",
           "use millimetres to the right, up and away from the panel's centre");
  std::array<double, 3> place{};
  for (size_t k = 0; k < place.size(); ++k) place.at(k) = real("eye", value[k]);
  if (!(place[2] > 0.0)) refuse("eye: not in front of the panel");
  return place;
}

double seconds(const json& value) {
  const double given = real("seconds", value);
  if (given > 0.0 && given <= kMaxSeconds) return given;
  refuse(fmt::format("seconds: not above 0 and at most {}", kMaxSeconds));
}

uint32_t permille(const json& value) {
  const double factor = real("factor", value);
  if (factor >= kLeastSpeed && factor <= kMostSpeed)
    return static_cast<uint32_t>(std::lround(factor * 1000.0));
  refuse("factor: out of range", fmt::format("a number from {} to {}; 1 is the content's own rate",
                                             kLeastSpeed, kMostSpeed));
}

double decibels(const json& value) {
  const double db = real("db", value);
  if (db >= kLeastVolumeDb && db <= kMostVolumeDb) return db;
  refuse("db: out of range", fmt::format("a number from {} to {}; 0 leaves the sound as it is",
                                         kLeastVolumeDb, kMostVolumeDb));
}

bool flag(const std::string& field, const json& value) {
  if (value.is_boolean()) return value.get<bool>();
  refuse(fmt::format("{}: not true or false", field));
}

bool on_or_off(const json& value) {
  if (value == "on" || value == "off") return value == "on";
  refuse("to: not \"on\" or \"off\"");
}

void take_field(const std::string& field, const json& value, ControlRequest& request) {
  if (field == "source") request.source = words(field, value);
  if (field == "frame") request.frame = whole(field, value);
  if (field == "item") request.item = whole(field, value);
  if (field == "seconds") request.seconds = seconds(value);
  if (field == "then_back") request.then_back = flag(field, value);
  if (field == "factor") request.speed_permille = permille(value);
  if (field == "to") request.on = on_or_off(value);
  if (field == "db") request.volume_db = decibels(value);
  if (field == "count") request.loops = count_of_loops(value);
  if (field == "offset" || field == "offset_by") request.offset_lenses = real(field, value);
  if (field == "pitch" || field == "pitch_by") request.pitch_relative = real(field, value);
  if (field == "offset_by" || field == "pitch_by") request.relative = true;
  if (field == "toml") request.rig_toml = words(field, value, kMaxControlLine);
  if (field == "file") request.file = words(field, value);
  if (field == "eye") request.eye_mm = eye(value);
  if (field == "panel") request.panel = words(field, value);
}

/// Returns the overlay that the request states; none for {"off": true}.
std::optional<OverlaySpec> overlay_of(json keys) {
  for (const char* key : {"id", "do"}) keys.erase(key);
  if (keys == json{{"off", true}}) return std::nullopt;
  if (keys.contains("off")) refuse("off: neither true nor the only field");
  return parse_overlay(keys);
}

/// Checks that the verb's required fields are present and that the given fields go together.
void check_complete(const VerbRow& row, const ControlRequest& request, const json& line) {
  if (row.needed != nullptr && !line.contains(row.needed))
    refuse(fmt::format("{}: no {}", row.name, row.needed));
  if ((request.verb == "interrupt" || request.verb == "cue") &&
      request.source.empty() == !request.item)
    refuse(fmt::format("{}: expected either source or item", row.name));
  const std::string& file = line.contains("picture") ? request.overlay->content : request.file;
  if ((request.verb == "snapshot" || line.contains("picture")) && file.front() != '/')
    refuse(fmt::format("{}: not an absolute path", request.overlay ? "picture" : "file"),
           "the player's working folder may differ from yours");
  if (request.verb == "seek" && !request.frame && !request.item)
    refuse("seek: frame and item are missing");
  if (request.verb == "trim" && !request.offset_lenses && !request.pitch_relative)
    refuse("trim: nothing to change");
  if (request.relative && (line.contains("offset") || line.contains("pitch")))
    refuse("trim: absolute and relative values cannot be combined");
}

}  // namespace

ControlRequest parse_control_request(std::string_view text, json& id) {
  id = nullptr;
  const json line = json::parse(text, nullptr, false);
  if (!line.is_object())
    refuse("request: not a JSON object on one line", R"(for example {"id":1,"do":"status"})");
  if (line.contains("id") && is_id(line["id"])) id = line["id"];
  if (line.contains("id") && !is_id(line["id"])) refuse("id: not a whole number or a short string");
  if (!line.contains("do") || !line["do"].is_string()) refuse("do: missing, or not a string");
  const auto& name = line["do"].get_ref<const std::string&>();
  const auto row = std::ranges::find(verbs(), name, &VerbRow::name);
  if (row == verbs().end())
    refuse(fmt::format("do: unknown verb '{}'", name.substr(0, kMaxIdBytes)));

  ControlRequest request{.id = id, .verb = row->name};
  for (const auto& [field, value] : line.items()) {
    if (field == "id" || field == "do") continue;
    if (std::find(row->fields.begin(), row->fields.end(), field) == row->fields.end())
      refuse(fmt::format("{}: unknown field '{}'", name, field.substr(0, kMaxIdBytes)));
    take_field(field, value, request);
  }
  if (request.verb == "overlay") request.overlay = overlay_of(line);
  check_complete(*row, request, line);
  return request;
}

std::string answer_line(const json& id, ordered_json body) {
  ordered_json line = {{"id", id}, {"ok", true}};
  line.update(body);
  return event_line(line);
}

std::string error_line(const json& id, const Error& error, bool conflict) {
  const std::string what = error.what();
  const size_t colon = what.find(": ");
  const bool split = colon != std::string::npos;
  ordered_json line = {{"id", id},
                       {"ok", false},
                       {"error",
                        {{"object", split ? what.substr(0, colon) : ""},
                         {"cause", split ? what.substr(colon + 2) : what},
                         {"remedy", error.hint()},
                         {"kind", static_cast<int>(error.kind())}}}};
  if (conflict) line["error"]["conflict"] = true;
  return event_line(line);
}

std::string event_line(const ordered_json& event) { return json_text(event) + "\n"; }

}  // namespace lenticule::player
