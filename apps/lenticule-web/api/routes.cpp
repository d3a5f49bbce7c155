// SPDX-License-Identifier: Apache-2.0
// The addresses: first the functions that answer, then the table that names for each its rights,
// its largest body and what the description says.
#include "apps/lenticule-web/api/routes.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <utility>

#include "apps/lenticule-web/api/metrics.h"
#include "apps/lenticule-web/api/web_site.h"
#include "apps/lenticule-web/http/page_files.h"
#include "apps/lenticule-web/http/parse.h"
#include "base/json_output.h"
#include "base/numbers.h"
#include "base/text.h"

namespace lenticule::web {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

// --- values of requests; other values than expected are an HttpError 400 ------------------

/// Returns the body; an empty object for a request without a body.
ordered_json json_body(const Request& request) {
  if (request.body.empty()) return ordered_json::object();
  ordered_json body = ordered_json::parse(request.body, nullptr, false);
  if (!body.is_object()) throw HttpError(400, "the body is not a JSON object");
  return body;
}
/// Returns the number; none if the object does not contain it.
std::optional<double> body_number(const ordered_json& body, const char* key) {
  if (!body.contains(key)) return std::nullopt;
  if (!body[key].is_number() || !std::isfinite(body[key].get<double>()))
    throw HttpError(400, fmt::format("{}: not a number", key));
  return body[key].get<double>();
}
/// Returns the number of an entry of a history, which begin with 1.
uint64_t number_in_body(const Request& request) {
  const auto number = body_number(json_body(request), "number").value_or(0.0);
  return static_cast<uint64_t>(std::clamp(number, 0.0, 1e15));
}
std::string body_text(const ordered_json& body, const char* key) {
  if (!body.contains(key) || !body[key].is_string() || body[key].get<std::string>().size() > 4096)
    throw HttpError(400, fmt::format("{}: missing, or not a text", key));
  return body[key].get<std::string>();
}
/// Returns the number of the query; if it is missing, `otherwise`, if there is one.
double query_number(const Request& request, const char* key, std::optional<double> otherwise) {
  const auto text = request.query(key);
  if (!text && otherwise) return *otherwise;
  const auto value = number_from<double>(text.value_or(""));
  if (!value || std::abs(*value) > 1e6)
    throw HttpError(400, fmt::format("{}: missing, or not a number", key));
  return *value;
}

// --- pages --------------------------------------------------------------------------------

Response get_page(const Call& call) {
  const std::string& path = call.request.path;
  return page_response(path == "/" ? "now.html" : path.substr(1) + ".html", call.request);
}
Response get_description(const Call&) {
  static const ordered_json description = api_description();
  return json_response(description);
}

// --- state of player and machine ----------------------------------------------------------

/// Returns the player's state, the rights of the sender and the values of the machine.
ordered_json state_json(const Call& call) {
  ordered_json state = call.site.player().state();
  state["rights"] = rights_name(call.request.sender.rights);
  state["name"] = call.request.sender.name;
  state["machine"] = machine_json();
  return state;
}

constexpr auto kHeartbeat = std::chrono::seconds(10);

/// Sends the whole state first, then the messages as they come.
Response get_events(const Call& call) {
  PlayerState& player = call.site.player();
  uint64_t after = player.newest();
  Response response;
  response.type = "text/event-stream";
  response.headers.emplace_back("X-Accel-Buffering", "no");
  std::string first = fmt::format("retry: 2000\nid: {}\nevent: state\ndata: {}\n\n", after,
                                  json_text(state_json(call)));
  response.events = [&player, after, first]() mutable -> std::optional<std::string> {
    if (!first.empty()) return std::exchange(first, {});
    const std::vector<Message> messages = player.wait_for(after, kHeartbeat);
    if (player.stopped()) return std::nullopt;
    std::string text;
    for (const Message& message : messages) {
      after = message.number;
      text += fmt::format("id: {}\nevent: {}\ndata: {}\n\n", message.number, escaped(message.name),
                          message.text);
    }
    return text.empty() ? ": nothing new\n\n" : text;
  };
  return response;
}

Response get_report(const Call& call) {
  Response response = json_response({{"time", call.site.clock().date()},
                                     {"version", LENTICULE_VERSION},
                                     {"state", state_json(call)},
                                     {"health", health_json(call.site.player())},
                                     {"statistics", call.site.player().statistics()},
                                     {"trims", call.site.trims().to_json()}});
  response.headers.emplace_back("Content-Disposition",
                                "attachment; filename=\"lenticule-report.json\"");
  return response;
}

Response plain_response(const char* type, std::string body) {
  return {.type = type, .body = std::move(body)};
}

// --- changes of the picture on the panel --------------------------------------------------

Response ask_player(const Call& call, ordered_json question) {
  ordered_json answer = call.site.link().ask(std::move(question), kOpeningTime).body;
  call.site.player().refresh();
  return json_response(answer);
}
/// Returns the question of the last word of the path, which is a verb of the player.
ordered_json question_of(const Call& call, std::initializer_list<const char*> keys = {}) {
  const std::string& path = call.request.path;
  ordered_json question = {{"do", path.substr(path.rfind('/') + 1)}};
  const ordered_json body = keys.size() > 0 ? json_body(call.request) : ordered_json::object();
  for (const char* key : keys)
    if (body.contains(key)) question[key] = body[key];
  return question;
}
Response post_verb(const Call& call) { return ask_player(call, question_of(call)); }
Response post_seek(const Call& call) {
  return ask_player(call, question_of(call, {"item", "frame"}));
}
/// Sends a target: an item of the list, or a file of the media folder.
Response post_target(const Call& call) {
  ordered_json question = question_of(call, {"item", "frame", "seconds", "then_back"});
  const ordered_json body = json_body(call.request);
  if (body.contains("file"))
    question["source"] = call.site.media().path_of(body_text(body, "file")).string();
  return ask_player(call, std::move(question));
}
Response post_number(const Call& call, const char* key) {
  const auto number = body_number(json_body(call.request), key);
  if (!number) throw HttpError(400, fmt::format("{}: missing", key));
  ordered_json question = question_of(call);
  question[key] = *number;
  return ask_player(call, std::move(question));
}

Response post_show(const Call& call) {
  show(call.site.link(), body_text(json_body(call.request), "what"));
  call.site.player().refresh();
  return json_response(state_json(call));
}

// --- pictures of the displayed frame, and the optics that they show -----------------------

int width_in_query(const Request& request) {
  const double width = query_number(request, "width", 640.0);
  if (width < PictureMaker::kMinWidth || width > PictureMaker::kMaxWidth)
    throw HttpError(400, fmt::format("width: expected {} to {}", PictureMaker::kMinWidth,
                                     PictureMaker::kMaxWidth));
  return static_cast<int>(width);
}

Response get_frame(const Call& call) {
  const Rights rights = call.request.sender.rights;
  return plain_response("image/jpeg",
                        call.site.pictures().frame(width_in_query(call.request), rights));
}

Response get_eye(const Call& call) {
  const optics::Eye eye{.x = query_number(call.request, "x", std::nullopt),
                        .y = query_number(call.request, "y", 0.0),
                        .z_mm = query_number(call.request, "z", std::nullopt)};
  if (eye.z_mm < 1.0) throw HttpError(400, "z: expected at least 1 mm in front of the panel");
  const Rights rights = call.request.sender.rights;
  return plain_response("image/jpeg",
                        call.site.pictures().eye(eye, width_in_query(call.request), rights));
}

Response get_optics(const Call& call) {
  const optics::OpticalModel model = call.site.pictures().model();
  const optics::Rig& rig = model.rig();
  const double width = rig.panel.pixel_width.value * rig.panel.width_px;
  const double height = rig.panel.pixel_height.value * rig.panel.height_px;
  const double distance = rig.viewing.distance.value;
  return json_response({{"name", rig.name},
                        {"width_px", rig.panel.width_px},
                        {"height_px", rig.panel.height_px},
                        {"width_mm", width},
                        {"height_mm", height},
                        {"viewing_distance_mm", finite_or_null(distance)},
                        {"viewing_height_mm", rig.viewing.height.value},
                        {"lobe_width_mm", finite_or_null(model.lobe_width_mm(distance))},
                        {"views_per_lens", rig.sheet.pitch.value},
                        {"spot_sigma_lenses", rig.sheet.spot_sigma.value},
                        {"depth_of_field_mm", finite_or_null(model.depth_of_field_mm())}});
}

// --- the list and the files of the media folder -------------------------------------------

Response put_list(const Call& call) {
  ordered_json body = json_body(call.request);
  std::string version;
  if (body.contains("version")) version = body_text(body, "version");
  for (const char* key : {"version", "file", "editable", "by_hand", "warnings"}) body.erase(key);
  return json_response(call.site.list().replace(body, version, call.request.sender.name));
}
Response post_restore(const Call& call) {
  return json_response(call.site.list().restore(body_text(json_body(call.request), "name"),
                                                call.request.sender.name));
}
std::unique_ptr<BodySink> file_sink(const Call& call) {
  const auto text = call.request.header("Content-Range");
  const auto range = text ? parse_content_range(*text) : std::nullopt;
  if (text && !range)
    throw HttpError(400, "Content-Range: not understood", "for example bytes 0-99/1000");
  const auto length = call.request.header("Content-Length");
  if (length == "0") return nullptr;
  return call.site.media().upload(call.name, range,
                                  length ? number_from<uint64_t>(*length) : std::nullopt,
                                  call.request.query("replace") == "yes");
}
Response delete_file(const Call& call) {
  const fs::path file = call.site.media().path_of(call.name);
  std::string list;
  if (call.site.player().state()["connected"] == true && call.site.list().names(file, list))
    throw HttpError(409, call.name + ": is in the list " + list + ", which plays",
                    "remove it from the list first");
  call.site.media().remove(call.name);
  return json_response({{"deleted", call.name}});
}
Response post_restore_file(const Call& call) {
  call.site.media().restore(call.name);
  return json_response(call.site.media().info(call.name));
}

// --- the trim and its history -------------------------------------------------------------

ordered_json present_trim(const Call& call) {
  const ordered_json status = call.site.link().ask({{"do", "status"}}).body;
  if (!status.contains("trim") || !status["trim"].is_object())
    throw HttpError(409, "this player cannot change the trim");
  return status["trim"];
}

TrimEntry entry_of(const Call& call, const ordered_json& trim, const std::string& who) {
  return {.time = call.site.clock().date(),
          .who = who,
          .offset_lenses = trim.value("offset_lenses", 0.0),
          .pitch_relative = trim.value("pitch_relative", 0.0)};
}

Response trim_response(const Call& call, ordered_json trim) {
  trim["history"] = call.site.trims().to_json();
  return json_response(trim);
}

/// Sends the change to the player and returns its answer with the history.
Response change_trim(const Call& call, ordered_json question, bool keeps = true) {
  TrimHistory& trims = call.site.trims();
  // The values before the first change are the first entry, so that it can be undone.
  if (trims.to_json().empty()) trims.add(entry_of(call, present_trim(call), "before"));
  question["do"] = "trim";
  ordered_json trim = call.site.link().ask(std::move(question)).body;
  if (keeps) trims.add(entry_of(call, trim, call.request.sender.name));
  call.site.player().refresh();
  return trim_response(call, std::move(trim));
}

Response post_trim(const Call& call) {
  const ordered_json body = json_body(call.request);
  ordered_json question;
  for (const auto& [key, field] : {std::pair("offset_by_lenses", "offset_by"),
                                   {"pitch_by_relative", "pitch_by"},
                                   {"offset_lenses", "offset"},
                                   {"pitch_relative", "pitch"}})
    if (const auto value = body_number(body, key)) question[field] = *value;
  if (question.is_null()) throw HttpError(400, "nothing to change");
  return change_trim(call, std::move(question));
}
Response set_trim(const Call& call, const TrimEntry& entry, bool keeps) {
  return change_trim(call, {{"offset", entry.offset_lenses}, {"pitch", entry.pitch_relative}},
                     keeps);
}
Response post_trim_undo(const Call& call) {
  const auto entry = call.site.trims().undo();
  if (!entry) throw HttpError(409, "there is nothing to undo");
  return set_trim(call, *entry, false);
}
Response post_trim_restore(const Call& call) {
  const auto entry = call.site.trims().find(number_in_body(call.request));
  if (!entry) throw HttpError(404, "there is no trim of that number");
  return set_trim(call, *entry, true);
}
Response post_trim_save(const Call& call) {
  const std::string name = body_text(json_body(call.request), "name");
  if (name.empty()) throw HttpError(400, "name: missing");
  const ordered_json trim = present_trim(call);
  call.site.trims().name_newest(entry_of(call, trim, call.request.sender.name), name);
  return trim_response(call, trim);
}

// --- the calibration from photographs -----------------------------------------------------

Response get_calibration(const Call& call) {
  return json_response(call.site.calibration().state());
}
Response calibration_now(const Call& call) {
  call.site.player().refresh();
  return get_calibration(call);
}
Response post_calibration_begin(const Call& call) {
  call.site.calibration().begin();
  return calibration_now(call);
}
std::unique_ptr<BodySink> photograph_sink(const Call& call) {
  const Request& request = call.request;
  if (request.header("Content-Length") == "0") return nullptr;
  std::optional<double> distance_mm;
  if (request.query("distance")) {
    distance_mm = query_number(request, "distance", std::nullopt);
    if (*distance_mm < 1.0) throw HttpError(400, "distance: expected millimetres above 0");
  }
  return call.site.calibration().photograph(request.query("place"), distance_mm);
}
Response delete_photograph(const Call& call) {
  call.site.calibration().remove(call.request.query("place").value_or(""));
  return get_calibration(call);
}
Response get_calibration_picture(const Call& call) {
  const bool after = call.request.path.ends_with("/after.jpg");
  return plain_response("image/jpeg", call.site.calibration().picture(after));
}
Response get_calibration_rig(const Call& call) {
  Response response =
      plain_response("text/plain; charset=utf-8", call.site.calibration().rig_toml());
  response.headers.emplace_back("Content-Disposition", "attachment; filename=\"rig.toml\"");
  return response;
}
Response post_calibration_keep(const Call& call) {
  call.site.calibration().keep(call.request.sender.name);
  return calibration_now(call);
}
Response post_calibration_restore(const Call& call) {
  call.site.calibration().restore(number_in_body(call.request), call.request.sender.name);
  return calibration_now(call);
}
Response get_calibration_possible(const Call& call) {
  const std::string obstacle = call.site.calibration().obstacle();
  return json_response({{"possible", obstacle.empty()}, {"cause", obstacle}});
}
Response post_calibration_discard(const Call& call) {
  call.site.calibration().discard();
  return calibration_now(call);
}

// --- the table ----------------------------------------------------------------------------

/// Largest body of a request whose values are a few words and numbers.
constexpr uint64_t kSmallBody = 4096;
constexpr uint64_t kListBody = size_t{1} << 20;
constexpr uint64_t kFileBody = UINT64_MAX / 2;  ///< Media has a limit of its own

using Answer = Response (*)(const Call& call);

constexpr Route get(const char* path, const char* summary, const char* result, Answer answer,
                    const char* query = nullptr) {
  return {"GET", path, Rights::See, 0, answer, summary, result, nullptr, query};
}
constexpr Route page(const char* path, const char* summary) {
  return get(path, summary, "text/html", get_page);
}
constexpr Route post(const char* path, const char* summary, const char* result, Answer answer,
                     const char* body = nullptr) {
  return {"POST", path, Rights::Change, kSmallBody, answer, summary, result, body};
}
constexpr Route verb(const char* path, const char* summary) {
  return post(path, summary, "object", post_verb);
}

// The files of the pages are named in CMakeLists.txt, too.
constexpr std::array kRoutes = {
    page("/", "the page Now"),
    page("/eye", "the page Eye"),
    page("/trim", "the page Trim"),
    page("/calibrate", "the page Calibrate"),
    page("/health", "the page Health"),
    get("/metrics", "metrics in the text format of Prometheus", "text/plain",
        [](const Call& call) {
          return plain_response("text/plain; version=0.0.4; charset=utf-8",
                                metrics_text(call.site.player()));
        }),
    Route{"GET", "/api/v1/openapi.json", Rights::None, 0, get_description, "this description",
          "object"},
    get("/api/v1/state", "what the player does", "State",
        [](const Call& call) { return json_response(state_json(call)); }),
    get("/api/v1/events", "server-sent events: 'state', then the player's own events",
        "text/event-stream", get_events),
    verb("/api/v1/play", "continue after a pause"),
    verb("/api/v1/pause", "keep the displayed frame"),
    verb("/api/v1/next", "the next item"),
    verb("/api/v1/previous", "the previous item"),
    post("/api/v1/seek", "go to an item and a frame", "object", post_seek,
         R"({"item?": "integer", "frame?": "integer"})"),
    post("/api/v1/interrupt", "play an item of the list or a file once, then continue where it was",
         "object", post_target,
         R"({"item?": "integer", "file?": "string", "frame?": "integer", "seconds?": "number"})"),
    verb("/api/v1/blank", "show black until back"),
    verb("/api/v1/back", "end an interruption or a blank panel now"),
    post(
        "/api/v1/cue", "open and decode an item of the list or a file for go", "object",
        post_target,
        R"({"item?": "integer", "file?": "string", "frame?": "integer", "then_back?": "boolean"})"),
    verb("/api/v1/go", "show what is cued at the second vblank from now"),
    post(
        "/api/v1/speed", "play at a multiple of the content's rate, 0.1 to 8", "object",
        [](const Call& call) { return post_number(call, "factor"); }, R"({"factor": "number"})"),
    post(
        "/api/v1/volume", "set the volume in decibels, -80 to 12; 0 leaves the sound as it is",
        "object", [](const Call& call) { return post_number(call, "db"); }, R"({"db": "number"})"),
    post(
        "/api/v1/power", "switch the output off or on", "object",
        [](const Call& call) {
          const std::string to = body_text(json_body(call.request), "to");
          return ask_player(call, {{"do", "power"}, {"to", to}});
        },
        R"({"to": "on|off"})"),
    post("/api/v1/show", "show something else than the content, or the content again", "State",
         post_show, R"({"what": "black|card|views|content"})"),
    get("/api/v1/frame.jpg", "the woven frame, reduced", "image/jpeg", get_frame,
        R"({"width?": "number: 64 to 1920"})"),
    get("/api/v1/eye.jpg", "what an eye sees, in mm right, up and away from the panel's centre",
        "image/jpeg", get_eye,
        R"({"x": "number", "y?": "number", "z": "number", "width?": "number: 64 to 1920"})"),
    get("/api/v1/optics", "the rig for which frames are woven", "Optics", get_optics),
    get("/api/v1/list", "the list", "List",
        [](const Call& call) { return json_response(call.site.list().read()); }),
    Route{
        "PUT", "/api/v1/list", Rights::Change, kListBody, put_list,
        "replace the list; the old one is put back if the player cannot play it or any item of it",
        "List", "NewList"},
    get("/api/v1/list/versions", "earlier versions, newest first", "Versions",
        [](const Call& call) { return json_response(call.site.list().versions()); }),
    post("/api/v1/list/restore", "put an earlier version back", "List", post_restore,
         R"({"name": "string"})"),
    get("/api/v1/media", "the files", "Files",
        [](const Call& call) { return json_response(call.site.media().list()); }),
    get("/api/v1/media/{name}", "one file; 'received' is where an upload continues", "File",
        [](const Call& call) { return json_response(call.site.media().info(call.name)); }),
    Route{"PUT", "/api/v1/media/{name}", Rights::Change, kFileBody,
          [](const Call&) -> Response { throw HttpError(400, "the file is empty"); },
          "upload a file, or with Content-Range its next part; a file that exists is replaced with "
          "replace=yes only, if the new one plays, and kept",
          "File", "application/octet-stream", R"({"replace?": "yes|no"})", file_sink, 201},
    Route{"DELETE", "/api/v1/media/{name}", Rights::Change, kSmallBody, delete_file,
          "delete a file that is in no list of the media folder, and the one that it replaced",
          R"({"deleted": "string"})"},
    post("/api/v1/media/{name}/check", "does the file play on this panel?", "Check",
         [](const Call& call) { return json_response(call.site.media().check(call.name, true)); }),
    post("/api/v1/media/{name}/restore",
         "exchange the file and the one that it replaced, if that one plays", "File",
         post_restore_file),
    get("/api/v1/trim", "the trim and its history", "Trim",
        [](const Call& call) { return trim_response(call, present_trim(call)); }),
    post("/api/v1/trim", "change the trim", "Trim", post_trim,
         R"({"offset_by_lenses?": "number", "pitch_by_relative?": "number", )"
         R"("offset_lenses?": "number", "pitch_relative?": "number"})"),
    post("/api/v1/trim/undo", "undo the last change", "Trim", post_trim_undo),
    post("/api/v1/trim/restore", "go back to an entry of the history", "Trim", post_trim_restore,
         R"({"number": "integer"})"),
    post("/api/v1/trim/save", "give the present trim a name", "Trim", post_trim_save,
         R"({"name": "string"})"),
    get("/api/v1/calibration",
        "the calibration with photographs: its stage, the photographs, the fit and the result",
        "Calibration", get_calibration),
    get("/api/v1/calibration/possible",
        "whether the chart fits the panel, and the cause if it does not",
        R"({"possible": "boolean", "cause": "string"})", get_calibration_possible),
    post("/api/v1/calibration/begin", "show the chart of the present rig", "Calibration",
         post_calibration_begin),
    Route{"PUT", "/api/v1/calibration/photograph", Rights::Change, PhotoCalibration::kLargestPhoto,
          [](const Call&) -> Response { throw HttpError(400, "the photograph is empty"); },
          "send a photograph of the chart, and get the fit of all photographs so far; nothing is "
          "saved",
          "Calibration", "image/jpeg image/png",
          R"({"place?": "middle|left|right|right-again|left-again|middle-again: from where )"
          R"(it was taken; )"
          R"(default: the next place that was asked for. Replaces the photograph of that place )"
          R"(unless it is refused", "distance?": "number: mm from the panel to the camera, )"
          R"(used while there is one photograph"})",
          photograph_sink},
    Route{"DELETE", "/api/v1/calibration/photograph", Rights::Change, kSmallBody, delete_photograph,
          "remove a photograph, and get the fit of the others", "Calibration", nullptr,
          R"({"place": "middle|left|right|right-again|left-again|middle-again"})"},
    get("/api/v1/calibration/before.jpg",
        "a picture that is white for the camera of the first photograph only, drawn with the "
        "present rig, as that camera would see it",
        "image/jpeg", get_calibration_picture),
    get("/api/v1/calibration/after.jpg", "the same with the found rig", "image/jpeg",
        get_calibration_picture),
    get("/api/v1/calibration/rig.toml", "the found rig", "text/plain", get_calibration_rig),
    post("/api/v1/calibration/keep",
         "let the player replace its rig file by the found rig, and add both to the history",
         "Calibration", post_calibration_keep),
    post("/api/v1/calibration/restore", "let the player replace its rig file by one of the history",
         "Calibration", post_calibration_restore, R"({"number": "integer"})"),
    post("/api/v1/calibration/discard", "forget the photographs, and show the content again",
         "Calibration", post_calibration_discard),
    get("/api/v1/health", "is everything as it should be?", "Health",
        [](const Call& call) { return json_response(health_json(call.site.player())); }),
    get("/api/v1/report", "everything above in one file", "Report", get_report),
};

/// Returns the text for "{name}" if the path fits the pattern; none if it does not.
std::optional<std::string> fits(std::string_view pattern, std::string_view path) {
  const size_t open = pattern.find("{name}");
  if (open == std::string_view::npos)
    return pattern == path ? std::optional<std::string>("") : std::nullopt;
  const std::string_view before = pattern.substr(0, open);
  const std::string_view after = pattern.substr(open + 6);
  if (path.size() <= before.size() + after.size() || !path.starts_with(before) ||
      !path.ends_with(after))
    return std::nullopt;
  const std::string_view name =
      path.substr(before.size(), path.size() - before.size() - after.size());
  if (name.find('/') != std::string_view::npos) return std::nullopt;
  return std::string(name);
}

}  // namespace

std::span<const Route> routes() { return kRoutes; }

FoundRoute find_route(const std::string& method, const std::string& path) {
  FoundRoute found;
  const std::string wanted = method == "HEAD" ? "GET" : method;
  for (const Route& route : kRoutes) {
    const auto name = fits(route.path, path);
    if (!name) continue;
    if (wanted == route.method) return {.route = &route, .name = *name};
    found.other_method = true;
  }
  return found;
}

std::string_view asset_of(std::string_view path) {
  if (!path.starts_with('/')) return {};
  path.remove_prefix(1);
  return path.ends_with(".css") || path.ends_with(".js") || path.ends_with(".svg")
             ? path
             : std::string_view();
}

Response page_response(std::string_view name, const Request& request) {
  const auto files = page_files();
  const auto file = std::find_if(files.begin(), files.end(),
                                 [&](const PageFile& one) { return one.name == name; });
  if (file == files.end()) throw HttpError(404, "there is no such page");
  Response response;
  response.type = file->type;
  response.headers = {{"Cache-Control", "no-cache"}, {"ETag", file->tag}};
  if (request.header("If-None-Match").value_or("") == file->tag)
    response.status = 304;
  else
    response.borrowed = file->bytes;
  return response;
}

}  // namespace lenticule::web
