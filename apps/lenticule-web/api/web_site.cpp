// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/web_site.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "apps/lenticule-web/api/metrics.h"
#include "apps/lenticule-web/http/page_files.h"
#include "apps/lenticule-web/http/parse.h"
#include "base/error.h"
#include "base/file.h"
#include "base/numbers.h"
#include "base/subprocess.h"
#include "base/temporary.h"
#include "base/text.h"
#include "optics/rig_file.h"

namespace lenticule::web {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using std::chrono::seconds;

constexpr uint64_t kSmallBody = 4096;
constexpr uint64_t kListBody = size_t{1} << 20;
constexpr uint64_t kFileBody = UINT64_MAX / 2;  ///< Media has a limit of its own
constexpr auto kHeartbeat = seconds(10);
constexpr auto kJumpTime = seconds(60);
constexpr const char* kMediaPath = "/api/v1/media/{name}";

// --- parts of requests ----------------------------------------------------------------------

ordered_json object_of(const Request& request) {
  if (request.body.empty()) return ordered_json::object();
  ordered_json body = ordered_json::parse(request.body, nullptr, false);
  if (!body.is_object()) throw HttpError(400, "the body is not a JSON object");
  return body;
}

std::optional<double> number_in(const ordered_json& body, const char* key) {
  if (!body.contains(key)) return std::nullopt;
  if (!body[key].is_number() || !std::isfinite(body[key].get<double>()))
    throw HttpError(400, fmt::format("{}: not a number", key));
  return body[key].get<double>();
}

std::string text_in(const ordered_json& body, const char* key) {
  if (!body.contains(key) || !body[key].is_string() || body[key].get<std::string>().size() > 4096)
    throw HttpError(400, fmt::format("{}: missing, or not a text", key));
  return body[key].get<std::string>();
}

double number_in_query(const Request& request, const char* key, std::optional<double> otherwise) {
  const auto text = request.query(key);
  if (!text && otherwise) return *otherwise;
  const auto value = number_from<double>(text.value_or(""));
  if (!value || std::abs(*value) > 1e6)
    throw HttpError(400, fmt::format("{}: missing, or not a number", key));
  return *value;
}

int width_in_query(const Request& request) {
  const double width = number_in_query(request, "width", 640.0);
  if (width < PictureMaker::kMinWidth || width > PictureMaker::kMaxWidth)
    throw HttpError(400, fmt::format("width: expected {} to {}", PictureMaker::kMinWidth,
                                     PictureMaker::kMaxWidth));
  return static_cast<int>(width);
}

// --- state and events -----------------------------------------------------------------------

ordered_json state_json(WebSite& site, const Request& request) {
  ordered_json state = site.player().state();
  state["shown_instead"] = ShownInstead::shown(state["status"]);
  state["rights"] = rights_name(request.sender.rights);
  state["name"] = request.sender.name;
  state["machine"] = machine_json();
  return state;
}

/// StateEvents sends the whole state first, then the messages as they come.
class StateEvents final : public EventStream {
 public:
  StateEvents(PlayerState& player, uint64_t after, std::string first)
      : player_(player), after_(after), first_(std::move(first)) {}

  std::optional<std::string> next() override {
    if (!first_.empty()) return std::exchange(first_, {});
    const std::vector<Message> messages = player_.wait_for(after_, kHeartbeat);
    if (player_.stopped()) return std::nullopt;
    std::string text;
    for (const Message& message : messages) {
      after_ = message.number;
      text += fmt::format("id: {}\nevent: {}\ndata: {}\n\n", message.number, escaped(message.name),
                          message.text);
    }
    return text.empty() ? ": nothing new\n\n" : text;
  }

 private:
  PlayerState& player_;
  uint64_t after_;
  std::string first_;
};

Response get_state(WebSite& site, const Request& request, const std::string&) {
  return json_response(state_json(site, request));
}

Response get_events(WebSite& site, const Request& request, const std::string&) {
  const uint64_t newest = site.player().newest();
  Response response;
  response.type = "text/event-stream";
  response.headers.emplace_back("X-Accel-Buffering", "no");
  response.events =
      std::make_unique<StateEvents>(site.player(), newest,
                                    fmt::format("retry: 2000\nid: {}\nevent: state\ndata: {}\n\n",
                                                newest, json_text(state_json(site, request))));
  return response;
}

// --- playing --------------------------------------------------------------------------------

Response ask_player(WebSite& site, ordered_json question) {
  ordered_json answer = site.link().ask(std::move(question), kJumpTime).body;
  site.player().refresh();
  return json_response(answer);
}
template <const char* kVerb>
Response post_verb(WebSite& site, const Request&, const std::string&) {
  return ask_player(site, {{"do", kVerb}});
}
constexpr char kPlay[] = "play";
constexpr char kPause[] = "pause";
constexpr char kNext[] = "next";
constexpr char kPrevious[] = "previous";
constexpr char kBlank[] = "blank";
constexpr char kBack[] = "back";
constexpr char kGo[] = "go";

Response post_seek(WebSite& site, const Request& request, const std::string&) {
  ordered_json question = {{"do", "seek"}};
  const ordered_json body = object_of(request);
  for (const char* key : {"item", "frame"})
    if (body.contains(key)) question[key] = body[key];
  return ask_player(site, std::move(question));
}

/// Adds the target of an interruption or a cue: an item of the list, or a file of the media folder.
void put_target(WebSite& site, const ordered_json& body, ordered_json& question) {
  for (const char* key : {"item", "frame", "seconds", "then_back"})
    if (body.contains(key)) question[key] = body[key];
  if (body.contains("file"))
    question["source"] = site.media().path_of(text_in(body, "file")).string();
}

Response post_interrupt(WebSite& site, const Request& request, const std::string&) {
  ordered_json question = {{"do", "interrupt"}};
  put_target(site, object_of(request), question);
  return ask_player(site, std::move(question));
}

Response post_cue(WebSite& site, const Request& request, const std::string&) {
  ordered_json question = {{"do", "cue"}};
  put_target(site, object_of(request), question);
  return ask_player(site, std::move(question));
}

Response post_speed(WebSite& site, const Request& request, const std::string&) {
  const auto factor = number_in(object_of(request), "factor");
  if (!factor) throw HttpError(400, "factor: missing");
  return ask_player(site, {{"do", "speed"}, {"factor", *factor}});
}

Response post_power(WebSite& site, const Request& request, const std::string&) {
  return ask_player(site, {{"do", "power"}, {"to", text_in(object_of(request), "to")}});
}

Response post_show(WebSite& site, const Request& request, const std::string&) {
  site.shown_instead().show(text_in(object_of(request), "what"));
  site.player().refresh();
  return json_response(state_json(site, request));
}

// --- pictures and optics --------------------------------------------------------------------

Response picture(std::string jpeg) {
  Response response;
  response.type = "image/jpeg";
  response.body = std::move(jpeg);
  return response;
}

Response get_frame(WebSite& site, const Request& request, const std::string&) {
  return picture(site.pictures().frame(width_in_query(request), request.sender.rights));
}

Response get_eye(WebSite& site, const Request& request, const std::string&) {
  const optics::Eye eye{.x = number_in_query(request, "x", std::nullopt),
                        .y = number_in_query(request, "y", 0.0),
                        .z_mm = number_in_query(request, "z", std::nullopt)};
  if (eye.z_mm < 1.0) throw HttpError(400, "z: expected at least 1 mm in front of the panel");
  return picture(site.pictures().eye(eye, width_in_query(request), request.sender.rights));
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

// --- list and media -------------------------------------------------------------------------

Response get_list(WebSite& site, const Request&, const std::string&) {
  return json_response(site.list().read());
}
Response put_list(WebSite& site, const Request& request, const std::string&) {
  ordered_json body = object_of(request);
  std::string version;
  if (body.contains("version")) version = text_in(body, "version");
  for (const char* key : {"version", "file", "editable"}) body.erase(key);
  return json_response(site.list().replace(body, version, request.sender.name));
}
Response get_versions(WebSite& site, const Request&, const std::string&) {
  return json_response(site.list().versions());
}
Response post_restore(WebSite& site, const Request& request, const std::string&) {
  return json_response(
      site.list().restore(text_in(object_of(request), "name"), request.sender.name));
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
Response delete_file(WebSite& site, const Request&, const std::string& name) {
  const fs::path file = site.media().path_of(name);
  if (site.player().state()["connected"] == true && site.list().names(file))
    throw HttpError(409, name + ": is in the list", "remove it from the list first");
  site.media().remove(name);
  return json_response({{"deleted", name}});
}
Response post_check(WebSite& site, const Request&, const std::string& name) {
  return json_response(site.media().check(name));
}

// --- trim -----------------------------------------------------------------------------------

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
  const ordered_json body = object_of(request);
  ordered_json question;
  for (const auto& [key, field] : {std::pair("offset_by_lenses", "offset_by"),
                                   {"pitch_by_relative", "pitch_by"},
                                   {"offset_lenses", "offset"},
                                   {"pitch_relative", "pitch"}})
    if (const auto value = number_in(body, key)) question[field] = *value;
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
  const auto number = number_in(object_of(request), "number");
  const auto entry = site.trims().find(static_cast<uint64_t>(std::max(0.0, number.value_or(0.0))));
  if (!entry) throw HttpError(404, "there is no trim of that number");
  return set_trim(site, request, *entry, true);
}
Response post_trim_save(WebSite& site, const Request& request, const std::string&) {
  const std::string name = text_in(object_of(request), "name");
  if (name.empty()) throw HttpError(400, "name: missing");
  const ordered_json trim = present_trim(site);
  site.trims().name_newest(entry_of(site, trim, request.sender.name), name);
  return json_response(trim_json(site, trim));
}

// --- calibration ------------------------------------------------------------------------------

Response get_calibration(WebSite& site, const Request&, const std::string&) {
  return json_response(site.calibration().state());
}
Response post_calibration_begin(WebSite& site, const Request&, const std::string&) {
  site.calibration().begin();
  site.player().refresh();
  return json_response(site.calibration().state());
}
Response put_photograph(WebSite&, const Request&, const std::string&) {
  throw HttpError(400, "the photograph is empty");  // a body goes to the sink
}
Response delete_photograph(WebSite& site, const Request& request, const std::string&) {
  site.calibration().remove(request.query("place").value_or(""));
  return json_response(site.calibration().state());
}
Response get_calibration_before(WebSite& site, const Request&, const std::string&) {
  return picture(site.calibration().picture(false));
}
Response get_calibration_after(WebSite& site, const Request&, const std::string&) {
  return picture(site.calibration().picture(true));
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
  site.player().refresh();
  return json_response(site.calibration().state());
}
Response post_calibration_restore(WebSite& site, const Request& request, const std::string&) {
  const auto number = number_in(object_of(request), "number");
  site.calibration().restore(static_cast<uint64_t>(std::max(0.0, number.value_or(0.0))),
                             request.sender.name);
  site.player().refresh();
  return json_response(site.calibration().state());
}
Response get_calibration_possible(WebSite& site, const Request&, const std::string&) {
  const std::string obstacle = site.calibration().obstacle();
  return json_response({{"possible", obstacle.empty()}, {"cause", obstacle}});
}
Response post_calibration_discard(WebSite& site, const Request&, const std::string&) {
  site.calibration().discard();
  site.player().refresh();
  return json_response(site.calibration().state());
}

// --- health ---------------------------------------------------------------------------------

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

Response page(std::string_view name, const Request& request) {
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

template <const char* kName>
Response get_page(WebSite&, const Request& request, const std::string&) {
  return page(kName, request);
}
constexpr char kNowPage[] = "now.html";
constexpr char kEyePage[] = "eye.html";
constexpr char kTrimPage[] = "trim.html";
constexpr char kCalibratePage[] = "calibrate.html";
constexpr char kHealthPage[] = "health.html";
constexpr char kOpenApi[] = "openapi.json";

// One row per address. A page of its own also needs its files in CMakeLists.txt.
constexpr std::array kRoutes = {
    Route{"GET", "/", Rights::See, 0, get_page<kNowPage>},
    Route{"GET", "/eye", Rights::See, 0, get_page<kEyePage>},
    Route{"GET", "/trim", Rights::See, 0, get_page<kTrimPage>},
    Route{"GET", "/calibrate", Rights::See, 0, get_page<kCalibratePage>},
    Route{"GET", "/health", Rights::See, 0, get_page<kHealthPage>},
    Route{"GET", "/metrics", Rights::See, 0, get_metrics},
    Route{"GET", "/api/v1/openapi.json", Rights::None, 0, get_page<kOpenApi>},
    Route{"GET", "/api/v1/state", Rights::See, 0, get_state},
    Route{"GET", "/api/v1/events", Rights::See, 0, get_events},
    Route{"POST", "/api/v1/play", Rights::Change, kSmallBody, post_verb<kPlay>},
    Route{"POST", "/api/v1/pause", Rights::Change, kSmallBody, post_verb<kPause>},
    Route{"POST", "/api/v1/next", Rights::Change, kSmallBody, post_verb<kNext>},
    Route{"POST", "/api/v1/previous", Rights::Change, kSmallBody, post_verb<kPrevious>},
    Route{"POST", "/api/v1/seek", Rights::Change, kSmallBody, post_seek},
    Route{"POST", "/api/v1/interrupt", Rights::Change, kSmallBody, post_interrupt},
    Route{"POST", "/api/v1/blank", Rights::Change, kSmallBody, post_verb<kBlank>},
    Route{"POST", "/api/v1/back", Rights::Change, kSmallBody, post_verb<kBack>},
    Route{"POST", "/api/v1/cue", Rights::Change, kSmallBody, post_cue},
    Route{"POST", "/api/v1/go", Rights::Change, kSmallBody, post_verb<kGo>},
    Route{"POST", "/api/v1/speed", Rights::Change, kSmallBody, post_speed},
    Route{"POST", "/api/v1/power", Rights::Change, kSmallBody, post_power},
    Route{"POST", "/api/v1/show", Rights::Change, kSmallBody, post_show},
    Route{"GET", "/api/v1/frame.jpg", Rights::See, 0, get_frame},
    Route{"GET", "/api/v1/eye.jpg", Rights::See, 0, get_eye},
    Route{"GET", "/api/v1/optics", Rights::See, 0, get_optics},
    Route{"GET", "/api/v1/list", Rights::See, 0, get_list},
    Route{"PUT", "/api/v1/list", Rights::Change, kListBody, put_list},
    Route{"GET", "/api/v1/list/versions", Rights::See, 0, get_versions},
    Route{"POST", "/api/v1/list/restore", Rights::Change, kSmallBody, post_restore},
    Route{"GET", "/api/v1/media", Rights::See, 0, get_media},
    Route{"GET", kMediaPath, Rights::See, 0, get_file},
    Route{"PUT", kMediaPath, Rights::Change, kFileBody, put_file},
    Route{"DELETE", kMediaPath, Rights::Change, kSmallBody, delete_file},
    Route{"POST", "/api/v1/media/{name}/check", Rights::Change, kSmallBody, post_check},
    Route{"GET", "/api/v1/trim", Rights::See, 0, get_trim},
    Route{"POST", "/api/v1/trim", Rights::Change, kSmallBody, post_trim},
    Route{"POST", "/api/v1/trim/undo", Rights::Change, kSmallBody, post_trim_undo},
    Route{"POST", "/api/v1/trim/restore", Rights::Change, kSmallBody, post_trim_restore},
    Route{"POST", "/api/v1/trim/save", Rights::Change, kSmallBody, post_trim_save},
    Route{"GET", "/api/v1/calibration", Rights::See, 0, get_calibration},
    Route{"GET", "/api/v1/calibration/possible", Rights::See, 0, get_calibration_possible},
    Route{"POST", "/api/v1/calibration/begin", Rights::Change, kSmallBody, post_calibration_begin},
    Route{"PUT", "/api/v1/calibration/photograph", Rights::Change, PhotoCalibration::kLargestPhoto,
          put_photograph},
    Route{"DELETE", "/api/v1/calibration/photograph", Rights::Change, kSmallBody,
          delete_photograph},
    Route{"GET", "/api/v1/calibration/before.jpg", Rights::See, 0, get_calibration_before},
    Route{"GET", "/api/v1/calibration/after.jpg", Rights::See, 0, get_calibration_after},
    Route{"GET", "/api/v1/calibration/rig.toml", Rights::See, 0, get_calibration_rig},
    Route{"POST", "/api/v1/calibration/keep", Rights::Change, kSmallBody, post_calibration_keep},
    Route{"POST", "/api/v1/calibration/restore", Rights::Change, kSmallBody,
          post_calibration_restore},
    Route{"POST", "/api/v1/calibration/discard", Rights::Change, kSmallBody,
          post_calibration_discard},
    Route{"GET", "/api/v1/health", Rights::See, 0, get_health},
    Route{"GET", "/api/v1/report", Rights::See, 0, get_report},
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

struct Found {
  const Route* route = nullptr;
  std::string name;
  bool other_method = false;
};
Found find_route(const std::string& method, const std::string& path) {
  Found found;
  const std::string wanted = method == "HEAD" ? "GET" : method;
  for (const Route& route : kRoutes) {
    const auto name = fits(route.path, path);
    if (!name) continue;
    if (wanted == route.method) return {.route = &route, .name = *name};
    found.other_method = true;
  }
  return found;
}

/// Returns the name of a style, script or picture of the pages; empty for another path.
std::string_view asset_of(std::string_view path) {
  if (!path.starts_with('/')) return {};
  path.remove_prefix(1);
  return path.ends_with(".css") || path.ends_with(".js") || path.ends_with(".svg")
             ? path
             : std::string_view();
}

}  // namespace

std::span<const Route> routes() {
  return kRoutes;
}

WebSite::WebSite(WebSiteOptions options)
    : options_(std::move(options)),
      link_(options_.socket),
      player_(link_, *options_.clock),
      pictures_(link_),
      shown_instead_(link_, options_.state / "shown-before.json"),
      trims_(options_.state / "trims.json"),
      calibration_(link_, pictures_, shown_instead_,
                   {.folder = options_.state / "calibration",
                    .program = options_.program,
                    .stops = [this] { return player_.stopped(); },
                    .history = options_.state / "rigs.json"},
                   *options_.clock) {
  if (!options_.media) return;
  const fs::path folder = fs::canonical(*options_.media);
  media_ = std::make_unique<Media>(MediaOptions{.folder = folder,
                                                .largest_file = options_.largest_file,
                                                .keeps_free = options_.keeps_free},
                                   [this](const fs::path& file) { return check(file); });
  list_ =
      std::make_unique<PlayList>(link_, player_, folder / "list.toml", options_.state / "lists");
}

PlayList& WebSite::list() {
  if (!list_) throw HttpError(404, "this server has no media folder", "start it with --media");
  return *list_;
}

Media& WebSite::media() {
  if (!media_) throw HttpError(404, "this server has no media folder", "start it with --media");
  return *media_;
}

/// Lets the player's own program check the file, with the rig that is used now.
ordered_json WebSite::check(const fs::path& file) {
  const TemporaryFolder folder(options_.state);
  const fs::path rig = folder.path() / "rig.toml";
  write_text_file(rig, pictures_.rig_toml());
  const ProgramRun run = run_and_capture({options_.program.string(), "play", file.string(), "--rig",
                                          rig.string(), "--preflight", "--json"},
                                         seconds(30), [this] { return player_.stopped(); });
  // The messages on standard error come before the JSON.
  const size_t begin = run.output.find("[\n");
  const ordered_json rows = begin == std::string::npos
                                ? ordered_json()
                                : ordered_json::parse(run.output.substr(begin), nullptr, false);
  // A machine that plays at the same time may read more slowly than it plays, so a slow file is a
  // warning.
  ordered_json result = {{"plays", run.exit_code == 0 || run.exit_code == 5},
                         {"too_slow", run.exit_code == 5},
                         {"problems", ordered_json::array()},
                         {"figures", nullptr}};
  if (rows.is_array() && rows.size() == 1 && rows[0].is_object()) {
    result["problems"] = rows[0].value("problems", ordered_json::array());
    result["figures"] = rows[0].value("figures", ordered_json());
  } else {
    result["problems"].push_back(run.timed_out ? "the check took too long"
                                               : shortened(escaped(run.output), 400));
  }
  return result;
}

Rights WebSite::needed(const std::string& method, const std::string& path) const {
  if (!asset_of(path).empty()) return Rights::None;
  const Found found = find_route(method, path);
  return found.route != nullptr ? found.route->rights : Rights::See;
}

uint64_t WebSite::largest_body(const std::string& method, const std::string& path) const {
  const Found found = find_route(method, path);
  return found.route != nullptr ? found.route->largest_body : 0;
}

std::unique_ptr<BodySink> WebSite::photograph_sink(const Request& request) {
  if (request.header("Content-Length") == "0") return nullptr;
  std::optional<double> distance_mm;
  if (request.query("distance")) {
    distance_mm = number_in_query(request, "distance", std::nullopt);
    if (*distance_mm < 1.0) throw HttpError(400, "distance: expected millimetres above 0");
  }
  return calibration_.photograph({.place = request.query("place"), .distance_mm = distance_mm});
}

std::unique_ptr<BodySink> WebSite::sink(const Request& request) {
  const Found found = find_route(request.method, request.path);
  if (found.route == nullptr) return nullptr;
  if (found.route->answer == put_photograph) return photograph_sink(request);
  if (found.route->answer != put_file) return nullptr;
  const auto text = request.header("Content-Range");
  const auto range = text ? parse_content_range(*text) : std::nullopt;
  if (text && !range)
    throw HttpError(400, "Content-Range: not understood", "for example bytes 0-99/1000");
  const auto length = request.header("Content-Length");
  if (length == "0") return nullptr;
  return media().upload(found.name, range, length ? number_from<uint64_t>(*length) : std::nullopt);
}

Response WebSite::answer(const Request& request) {
  const Found found = find_route(request.method, request.path);
  if (found.route != nullptr) return found.route->answer(*this, request, found.name);
  if (found.other_method) throw HttpError(405, request.method + " is not possible here");
  const std::string_view asset = asset_of(request.path);
  if (!asset.empty() && (request.method == "GET" || request.method == "HEAD"))
    return page(asset, request);
  throw HttpError(404, "there is no such address", "the API is described at /api/v1/openapi.json");
}

}  // namespace lenticule::web
