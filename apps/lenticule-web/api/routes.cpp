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
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "apps/lenticule-web/api/metrics.h"
#include "apps/lenticule-web/api/web_site.h"
#include "apps/lenticule-web/http/page_files.h"
#include "apps/lenticule-web/http/parse.h"
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

Response get_page(WebSite&, const Request& request, const std::string&) {
  return page_response(request.path == "/" ? "now.html" : request.path.substr(1) + ".html",
                       request);
}
Response get_description(WebSite&, const Request&, const std::string&) {
  static const ordered_json description = api_description();
  return json_response(description);
}

// --- state of player and machine ----------------------------------------------------------

/// Returns the player's state, the rights of the sender and the values of the machine.
ordered_json state_json(WebSite& site, const Request& request) {
  ordered_json state = site.player().state();
  state["shown_instead"] = shown_instead(state["status"]);
  state["rights"] = rights_name(request.sender.rights);
  state["name"] = request.sender.name;
  state["machine"] = machine_json();
  return state;
}

constexpr auto kHeartbeat = std::chrono::seconds(10);

Response get_state(WebSite& site, const Request& request, const std::string&) {
  return json_response(state_json(site, request));
}

/// Sends the whole state first, then the messages as they come.
Response get_events(WebSite& site, const Request& request, const std::string&) {
  PlayerState& player = site.player();
  uint64_t after = player.newest();
  Response response;
  response.type = "text/event-stream";
  response.headers.emplace_back("X-Accel-Buffering", "no");
  std::string first = fmt::format("retry: 2000\nid: {}\nevent: state\ndata: {}\n\n", after,
                                  json_text(state_json(site, request)));
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

Response get_health(WebSite& site, const Request&, const std::string&) {
  return json_response(health_json(site.player()));
}
Response get_report(WebSite& site, const Request& request, const std::string&) {
  Response response = json_response({{"time", site.clock().date()},
                                     {"version", LENTICULE_VERSION},
                                     {"state", state_json(site, request)},
                                     {"health", health_json(site.player())},
                                     {"statistics", site.player().statistics()},
                                     {"trims", site.trims().to_json()}});
  response.headers.emplace_back("Content-Disposition",
                                "attachment; filename=\"lenticule-report.json\"");
  return response;
}
Response get_metrics(WebSite& site, const Request&, const std::string&) {
  Response response;
  response.type = "text/plain; version=0.0.4; charset=utf-8";
  response.body = metrics_text(site.player());
  return response;
}

// --- changes of the picture on the panel --------------------------------------------------

Response ask_player(WebSite& site, ordered_json question) {
  ordered_json answer = site.link().ask(std::move(question), kOpeningTime).body;
  site.player().refresh();
  return json_response(answer);
}
/// Sends the last word of the path, which is a verb of the player.
Response post_verb(WebSite& site, const Request& request, const std::string&) {
  return ask_player(site, {{"do", request.path.substr(request.path.rfind('/') + 1)}});
}
Response post_seek(WebSite& site, const Request& request, const std::string&) {
  ordered_json question = {{"do", "seek"}};
  const ordered_json body = json_body(request);
  for (const char* key : {"item", "frame"})
    if (body.contains(key)) question[key] = body[key];
  return ask_player(site, std::move(question));
}

/// Adds the target of an interruption or a cue: an item of the list, or a file of the media folder.
void put_target(WebSite& site, const ordered_json& body, ordered_json& question) {
  for (const char* key : {"item", "frame", "seconds", "then_back"})
    if (body.contains(key)) question[key] = body[key];
  if (body.contains("file"))
    question["source"] = site.media().path_of(body_text(body, "file")).string();
}

Response post_interrupt(WebSite& site, const Request& request, const std::string&) {
  ordered_json question = {{"do", "interrupt"}};
  put_target(site, json_body(request), question);
  return ask_player(site, std::move(question));
}

Response post_cue(WebSite& site, const Request& request, const std::string&) {
  ordered_json question = {{"do", "cue"}};
  put_target(site, json_body(request), question);
  return ask_player(site, std::move(question));
}

Response post_speed(WebSite& site, const Request& request, const std::string&) {
  const auto factor = body_number(json_body(request), "factor");
  if (!factor) throw HttpError(400, "factor: missing");
  return ask_player(site, {{"do", "speed"}, {"factor", *factor}});
}

Response post_volume(WebSite& site, const Request& request, const std::string&) {
  const auto db = body_number(json_body(request), "db");
  if (!db) throw HttpError(400, "db: missing");
  return ask_player(site, {{"do", "volume"}, {"db", *db}});
}

Response post_power(WebSite& site, const Request& request, const std::string&) {
  return ask_player(site, {{"do", "power"}, {"to", body_text(json_body(request), "to")}});
}

Response post_show(WebSite& site, const Request& request, const std::string&) {
  show(site.link(), body_text(json_body(request), "what"));
  site.player().refresh();
  return json_response(state_json(site, request));
}

// --- pictures of the displayed frame, and the optics that they show -----------------------

Response jpeg_response(std::string jpeg) {
  Response response;
  response.type = "image/jpeg";
  response.body = std::move(jpeg);
  return response;
}

int width_in_query(const Request& request) {
  const double width = query_number(request, "width", 640.0);
  if (width < PictureMaker::kMinWidth || width > PictureMaker::kMaxWidth)
    throw HttpError(400, fmt::format("width: expected {} to {}", PictureMaker::kMinWidth,
                                     PictureMaker::kMaxWidth));
  return static_cast<int>(width);
}

Response get_frame(WebSite& site, const Request& request, const std::string&) {
  return jpeg_response(site.pictures().frame(width_in_query(request), request.sender.rights));
}

Response get_eye(WebSite& site, const Request& request, const std::string&) {
  const optics::Eye eye{.x = query_number(request, "x", std::nullopt),
                        .y = query_number(request, "y", 0.0),
                        .z_mm = query_number(request, "z", std::nullopt)};
  if (eye.z_mm < 1.0) throw HttpError(400, "z: expected at least 1 mm in front of the panel");
  return jpeg_response(site.pictures().eye(eye, width_in_query(request), request.sender.rights));
}

Response get_optics(WebSite& site, const Request&, const std::string&) {
  const optics::OpticalModel model = site.pictures().model();
  const optics::Rig& rig = model.rig();
  const double width = rig.panel.pixel_width.value * rig.panel.width_px;
  const double height = rig.panel.pixel_height.value * rig.panel.height_px;
  const double distance = rig.viewing.distance.value;
  const auto finite = [](double value) {
    return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
  };
  return json_response({{"name", rig.name},
                        {"width_px", rig.panel.width_px},
                        {"height_px", rig.panel.height_px},
                        {"width_mm", width},
                        {"height_mm", height},
                        {"viewing_distance_mm", finite(distance)},
                        {"viewing_height_mm", rig.viewing.height.value},
                        {"lobe_width_mm", finite(model.lobe_width_mm(distance))},
                        {"views_per_lens", rig.sheet.pitch.value},
                        {"spot_sigma_lenses", rig.sheet.spot_sigma.value},
                        {"depth_of_field_mm", finite(model.depth_of_field_mm())}});
}

// --- the list and the files of the media folder -------------------------------------------

Response get_list(WebSite& site, const Request&, const std::string&) {
  return json_response(site.list().read());
}
Response put_list(WebSite& site, const Request& request, const std::string&) {
  ordered_json body = json_body(request);
  std::string version;
  if (body.contains("version")) version = body_text(body, "version");
  for (const char* key : {"version", "file", "editable", "by_hand", "warnings"}) body.erase(key);
  return json_response(site.list().replace(body, version, request.sender.name));
}
Response get_versions(WebSite& site, const Request&, const std::string&) {
  return json_response(site.list().versions());
}
Response post_restore(WebSite& site, const Request& request, const std::string&) {
  return json_response(
      site.list().restore(body_text(json_body(request), "name"), request.sender.name));
}
Response get_media(WebSite& site, const Request&, const std::string&) {
  return json_response(site.media().list());
}
Response get_file(WebSite& site, const Request&, const std::string& name) {
  return json_response(site.media().info(name));
}
Response put_file(WebSite&, const Request&, const std::string&) {
  throw HttpError(400, "the file is empty");  // a body goes to the sink
}
std::unique_ptr<BodySink> file_sink(WebSite& site, const Request& request,
                                    const std::string& name) {
  const auto text = request.header("Content-Range");
  const auto range = text ? parse_content_range(*text) : std::nullopt;
  if (text && !range)
    throw HttpError(400, "Content-Range: not understood", "for example bytes 0-99/1000");
  const auto length = request.header("Content-Length");
  if (length == "0") return nullptr;
  return site.media().upload(name, range, length ? number_from<uint64_t>(*length) : std::nullopt,
                             request.query("replace") == "yes");
}
Response delete_file(WebSite& site, const Request&, const std::string& name) {
  const fs::path file = site.media().path_of(name);
  std::string list;
  if (site.player().state()["connected"] == true && site.list().names(file, list))
    throw HttpError(409, name + ": is in the list " + list + ", which plays",
                    "remove it from the list first");
  site.media().remove(name);
  return json_response({{"deleted", name}});
}
Response post_check(WebSite& site, const Request&, const std::string& name) {
  return json_response(site.media().check(name, true));
}
Response post_restore_file(WebSite& site, const Request&, const std::string& name) {
  site.media().restore(name);
  return json_response(site.media().info(name));
}

// --- the trim and its history -------------------------------------------------------------

ordered_json present_trim(WebSite& site) {
  const ordered_json status = site.link().ask({{"do", "status"}}).body;
  if (!status.contains("trim") || !status["trim"].is_object())
    throw HttpError(409, "this player cannot change the trim");
  return status["trim"];
}

TrimEntry entry_of(const WebSite& site, const ordered_json& trim, const std::string& who) {
  return {.time = site.clock().date(),
          .who = who,
          .offset_lenses = trim.value("offset_lenses", 0.0),
          .pitch_relative = trim.value("pitch_relative", 0.0)};
}

ordered_json trim_json(WebSite& site, ordered_json trim) {
  trim["history"] = site.trims().to_json();
  return trim;
}

/// Sends the change to the player and returns its answer with the history.
ordered_json change_trim(WebSite& site, ordered_json question, const Request& request,
                         bool keeps = true) {
  // The values before the first change are the first entry, so that it can be undone.
  if (site.trims().to_json().empty())
    site.trims().add(entry_of(site, present_trim(site), "before"));
  question["do"] = "trim";
  ordered_json trim = site.link().ask(std::move(question)).body;
  if (keeps) site.trims().add(entry_of(site, trim, request.sender.name));
  site.player().refresh();
  return trim_json(site, std::move(trim));
}

Response get_trim(WebSite& site, const Request&, const std::string&) {
  return json_response(trim_json(site, present_trim(site)));
}
Response post_trim(WebSite& site, const Request& request, const std::string&) {
  const ordered_json body = json_body(request);
  ordered_json question;
  for (const auto& [key, field] : {std::pair("offset_by_lenses", "offset_by"),
                                   {"pitch_by_relative", "pitch_by"},
                                   {"offset_lenses", "offset"},
                                   {"pitch_relative", "pitch"}})
    if (const auto value = body_number(body, key)) question[field] = *value;
  if (question.is_null()) throw HttpError(400, "nothing to change");
  return json_response(change_trim(site, std::move(question), request));
}
Response set_trim(WebSite& site, const Request& request, const TrimEntry& entry, bool keeps) {
  return json_response(change_trim(
      site, {{"offset", entry.offset_lenses}, {"pitch", entry.pitch_relative}}, request, keeps));
}
Response post_trim_undo(WebSite& site, const Request& request, const std::string&) {
  const auto entry = site.trims().undo();
  if (!entry) throw HttpError(409, "there is nothing to undo");
  return set_trim(site, request, *entry, false);
}
Response post_trim_restore(WebSite& site, const Request& request, const std::string&) {
  const auto entry = site.trims().find(number_in_body(request));
  if (!entry) throw HttpError(404, "there is no trim of that number");
  return set_trim(site, request, *entry, true);
}
Response post_trim_save(WebSite& site, const Request& request, const std::string&) {
  const std::string name = body_text(json_body(request), "name");
  if (name.empty()) throw HttpError(400, "name: missing");
  const ordered_json trim = present_trim(site);
  site.trims().name_newest(entry_of(site, trim, request.sender.name), name);
  return json_response(trim_json(site, trim));
}

// --- the calibration from photographs -----------------------------------------------------

Response calibration_now(WebSite& site) {
  site.player().refresh();
  return json_response(site.calibration().state());
}
Response get_calibration(WebSite& site, const Request&, const std::string&) {
  return json_response(site.calibration().state());
}
Response post_calibration_begin(WebSite& site, const Request&, const std::string&) {
  site.calibration().begin();
  return calibration_now(site);
}
Response put_photograph(WebSite&, const Request&, const std::string&) {
  throw HttpError(400, "the photograph is empty");  // a body goes to the sink
}
std::unique_ptr<BodySink> photograph_sink(WebSite& site, const Request& request,
                                          const std::string&) {
  if (request.header("Content-Length") == "0") return nullptr;
  std::optional<double> distance_mm;
  if (request.query("distance")) {
    distance_mm = query_number(request, "distance", std::nullopt);
    if (*distance_mm < 1.0) throw HttpError(400, "distance: expected millimetres above 0");
  }
  return site.calibration().photograph(
      {.place = request.query("place"), .distance_mm = distance_mm});
}
Response delete_photograph(WebSite& site, const Request& request, const std::string&) {
  site.calibration().remove(request.query("place").value_or(""));
  return json_response(site.calibration().state());
}
Response get_calibration_picture(WebSite& site, const Request& request, const std::string&) {
  return jpeg_response(site.calibration().picture(request.path.ends_with("/after.jpg")));
}
Response get_calibration_rig(WebSite& site, const Request&, const std::string&) {
  Response response;
  response.type = "text/plain; charset=utf-8";
  response.body = site.calibration().rig_toml();
  response.headers.emplace_back("Content-Disposition", "attachment; filename=\"rig.toml\"");
  return response;
}
Response post_calibration_keep(WebSite& site, const Request& request, const std::string&) {
  site.calibration().keep(request.sender.name);
  return calibration_now(site);
}
Response post_calibration_restore(WebSite& site, const Request& request, const std::string&) {
  site.calibration().restore(number_in_body(request), request.sender.name);
  return calibration_now(site);
}
Response get_calibration_possible(WebSite& site, const Request&, const std::string&) {
  const std::string obstacle = site.calibration().obstacle();
  return json_response({{"possible", obstacle.empty()}, {"cause", obstacle}});
}
Response post_calibration_discard(WebSite& site, const Request&, const std::string&) {
  site.calibration().discard();
  return calibration_now(site);
}

// --- the table ----------------------------------------------------------------------------

/// Largest body of a request whose values are a few words and numbers.
constexpr uint64_t kSmallBody = 4096;
constexpr uint64_t kListBody = size_t{1} << 20;
constexpr uint64_t kFileBody = UINT64_MAX / 2;  ///< Media has a limit of its own

// The files of the pages are named in CMakeLists.txt, too.
constexpr std::array kRoutes = {
    Route{"GET", "/", Rights::See, 0, get_page, "the page Now", "text/html"},
    Route{"GET", "/eye", Rights::See, 0, get_page, "the page Eye", "text/html"},
    Route{"GET", "/trim", Rights::See, 0, get_page, "the page Trim", "text/html"},
    Route{"GET", "/calibrate", Rights::See, 0, get_page, "the page Calibrate", "text/html"},
    Route{"GET", "/health", Rights::See, 0, get_page, "the page Health", "text/html"},
    Route{"GET", "/metrics", Rights::See, 0, get_metrics,
          "metrics in the text format of Prometheus", "text/plain"},
    Route{"GET", "/api/v1/openapi.json", Rights::None, 0, get_description, "this description",
          "object"},
    Route{"GET", "/api/v1/state", Rights::See, 0, get_state, "what the player does", "State"},
    Route{"GET", "/api/v1/events", Rights::See, 0, get_events,
          "server-sent events: 'state', then the player's own events", "text/event-stream"},
    Route{"POST", "/api/v1/play", Rights::Change, kSmallBody, post_verb, "continue after a pause",
          "object"},
    Route{"POST", "/api/v1/pause", Rights::Change, kSmallBody, post_verb,
          "keep the displayed frame", "object"},
    Route{"POST", "/api/v1/next", Rights::Change, kSmallBody, post_verb, "the next item", "object"},
    Route{"POST", "/api/v1/previous", Rights::Change, kSmallBody, post_verb, "the previous item",
          "object"},
    Route{"POST", "/api/v1/seek", Rights::Change, kSmallBody, post_seek,
          "go to an item and a frame", "object", R"({"item?": "integer", "frame?": "integer"})"},
    Route{"POST", "/api/v1/interrupt", Rights::Change, kSmallBody, post_interrupt,
          "play an item of the list or a file once, then continue where it was", "object",
          R"({"item?": "integer", "file?": "string", "frame?": "integer", "seconds?": "number"})"},
    Route{"POST", "/api/v1/blank", Rights::Change, kSmallBody, post_verb, "show black until back",
          "object"},
    Route{"POST", "/api/v1/back", Rights::Change, kSmallBody, post_verb,
          "end an interruption or a blank panel now", "object"},
    Route{
        "POST", "/api/v1/cue", Rights::Change, kSmallBody, post_cue,
        "open and decode an item of the list or a file for go", "object",
        R"({"item?": "integer", "file?": "string", "frame?": "integer", "then_back?": "boolean"})"},
    Route{"POST", "/api/v1/go", Rights::Change, kSmallBody, post_verb,
          "show what is cued at the second vblank from now", "object"},
    Route{"POST", "/api/v1/speed", Rights::Change, kSmallBody, post_speed,
          "play at a multiple of the content's rate, 0.1 to 8", "object",
          R"({"factor": "number"})"},
    Route{"POST", "/api/v1/volume", Rights::Change, kSmallBody, post_volume,
          "set the volume in decibels, -80 to 12; 0 leaves the sound as it is", "object",
          R"({"db": "number"})"},
    Route{"POST", "/api/v1/power", Rights::Change, kSmallBody, post_power,
          "switch the output off or on", "object", R"({"to": "on|off"})"},
    Route{"POST", "/api/v1/show", Rights::Change, kSmallBody, post_show,
          "show something else than the content, or the content again", "State",
          R"({"what": "black|card|views|content"})"},
    Route{"GET", "/api/v1/frame.jpg", Rights::See, 0, get_frame, "the woven frame, reduced",
          "image/jpeg", nullptr, R"({"width?": "number: 64 to 1920"})"},
    Route{"GET", "/api/v1/eye.jpg", Rights::See, 0, get_eye,
          "what an eye sees, in mm right, up and away from the panel's centre", "image/jpeg",
          nullptr,
          R"({"x": "number", "y?": "number", "z": "number", "width?": "number: 64 to 1920"})"},
    Route{"GET", "/api/v1/optics", Rights::See, 0, get_optics, "the rig for which frames are woven",
          "Optics"},
    Route{"GET", "/api/v1/list", Rights::See, 0, get_list, "the list", "List"},
    Route{
        "PUT", "/api/v1/list", Rights::Change, kListBody, put_list,
        "replace the list; the old one is put back if the player cannot play it or any item of it",
        "List", "NewList"},
    Route{"GET", "/api/v1/list/versions", Rights::See, 0, get_versions,
          "earlier versions, newest first", "Versions"},
    Route{"POST", "/api/v1/list/restore", Rights::Change, kSmallBody, post_restore,
          "put an earlier version back", "List", R"({"name": "string"})"},
    Route{"GET", "/api/v1/media", Rights::See, 0, get_media, "the files", "Files"},
    Route{"GET", "/api/v1/media/{name}", Rights::See, 0, get_file,
          "one file; 'received' is where an upload continues", "File"},
    Route{"PUT", "/api/v1/media/{name}", Rights::Change, kFileBody, put_file,
          "upload a file, or with Content-Range its next part; a file that exists is replaced with "
          "replace=yes only, if the new one plays, and kept",
          "File", "application/octet-stream", R"({"replace?": "yes|no"})", file_sink, 201},
    Route{"DELETE", "/api/v1/media/{name}", Rights::Change, kSmallBody, delete_file,
          "delete a file that is in no list of the media folder, and the one that it replaced",
          R"({"deleted": "string"})"},
    Route{"POST", "/api/v1/media/{name}/check", Rights::Change, kSmallBody, post_check,
          "does the file play on this panel?", "Check"},
    Route{"POST", "/api/v1/media/{name}/restore", Rights::Change, kSmallBody, post_restore_file,
          "exchange the file and the one that it replaced, if that one plays", "File"},
    Route{"GET", "/api/v1/trim", Rights::See, 0, get_trim, "the trim and its history", "Trim"},
    Route{"POST", "/api/v1/trim", Rights::Change, kSmallBody, post_trim, "change the trim", "Trim",
          R"({"offset_by_lenses?": "number", "pitch_by_relative?": "number", )"
          R"("offset_lenses?": "number", "pitch_relative?": "number"})"},
    Route{"POST", "/api/v1/trim/undo", Rights::Change, kSmallBody, post_trim_undo,
          "undo the last change", "Trim"},
    Route{"POST", "/api/v1/trim/restore", Rights::Change, kSmallBody, post_trim_restore,
          "go back to an entry of the history", "Trim", R"({"number": "integer"})"},
    Route{"POST", "/api/v1/trim/save", Rights::Change, kSmallBody, post_trim_save,
          "give the present trim a name", "Trim", R"({"name": "string"})"},
    Route{"GET", "/api/v1/calibration", Rights::See, 0, get_calibration,
          "the calibration with photographs: its stage, the photographs, the fit and the result",
          "Calibration"},
    Route{"GET", "/api/v1/calibration/possible", Rights::See, 0, get_calibration_possible,
          "whether the chart fits the panel, and the cause if it does not",
          R"({"possible": "boolean", "cause": "string"})"},
    Route{"POST", "/api/v1/calibration/begin", Rights::Change, kSmallBody, post_calibration_begin,
          "show the chart of the present rig", "Calibration"},
    Route{"PUT", "/api/v1/calibration/photograph", Rights::Change, PhotoCalibration::kLargestPhoto,
          put_photograph,
          "send a photograph of the chart, and get the fit of all photographs so far; nothing is "
          "saved",
          "Calibration", "image/jpeg image/png",
          R"({"place?": "middle|left|right|right-again: from where it was taken; )"
          R"(default: the next place that was asked for. Replaces the photograph of that place )"
          R"(unless it is refused", "distance?": "number: mm from the panel to the camera, )"
          R"(used while there is one photograph"})",
          photograph_sink},
    Route{"DELETE", "/api/v1/calibration/photograph", Rights::Change, kSmallBody, delete_photograph,
          "remove a photograph, and get the fit of the others", "Calibration", nullptr,
          R"({"place": "middle|left|right|right-again"})"},
    Route{"GET", "/api/v1/calibration/before.jpg", Rights::See, 0, get_calibration_picture,
          "a picture that is white for the camera of the first photograph only, drawn with the "
          "present rig, as that camera would see it",
          "image/jpeg"},
    Route{"GET", "/api/v1/calibration/after.jpg", Rights::See, 0, get_calibration_picture,
          "the same with the found rig", "image/jpeg"},
    Route{"GET", "/api/v1/calibration/rig.toml", Rights::See, 0, get_calibration_rig,
          "the found rig", "text/plain"},
    Route{"POST", "/api/v1/calibration/keep", Rights::Change, kSmallBody, post_calibration_keep,
          "let the player replace its rig file by the found rig, and add both to the history",
          "Calibration"},
    Route{"POST", "/api/v1/calibration/restore", Rights::Change, kSmallBody,
          post_calibration_restore, "let the player replace its rig file by one of the history",
          "Calibration", R"({"number": "integer"})"},
    Route{"POST", "/api/v1/calibration/discard", Rights::Change, kSmallBody,
          post_calibration_discard, "forget the photographs, and show the content again",
          "Calibration"},
    Route{"GET", "/api/v1/health", Rights::See, 0, get_health, "is everything as it should be?",
          "Health"},
    Route{"GET", "/api/v1/report", Rights::See, 0, get_report, "everything above in one file",
          "Report"},
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

std::span<const Route> routes() {
  return kRoutes;
}

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
