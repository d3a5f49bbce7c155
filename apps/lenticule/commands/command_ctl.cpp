// SPDX-License-Identifier: Apache-2.0
// lenticule ctl controls a player that runs with --control.

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/option.h"
#include "base/error.h"
#include "base/exit_code.h"
#include "base/numbers.h"
#include "base/print.h"
#include "player/control/control_protocol.h"
#include "player/process/interrupt.h"
#include "player/sources/source_spec.h"

namespace lenticule::cli {
namespace {

using nlohmann::ordered_json;

constexpr size_t kMaxAddress = 500;
constexpr const char* kCode = "code";

[[noreturn]] void throw_error(const ordered_json& answer) {
  auto error = answer.value("error", ordered_json::object());
  if (!error.is_object()) error = ordered_json::object();
  const auto text = [&](const char* key) { return error.value(key, std::string()); };
  const int kind = error.value("kind", 1);
  const bool is_known =
      kind == static_cast<int>(ErrorKind::Usage) || kind == static_cast<int>(ErrorKind::Device);
  const std::string object = text("object");
  throw Error(is_known ? static_cast<ErrorKind>(kind) : ErrorKind::Failed,
              object.empty() ? text("cause") : object + ": " + text("cause"), text("remedy"));
}

std::string source_on_panel(const ordered_json& status) {
  const ordered_json place = status.value("displayed", ordered_json());
  return place.is_object() ? place.value("source", std::string()) : std::string();
}

/// Returns the request that plays again what is played now, at its place.
ordered_json return_request(const ordered_json& status, const ordered_json& list) {
  ordered_json request = {{"do", "load"}, {"source", list.value("file", ordered_json())}};
  const ordered_json items = list.value("items", ordered_json::array());
  if (request["source"].is_null() && !items.empty())
    request["source"] = items.front().value("source", ordered_json());
  const ordered_json place = status.value("displayed", ordered_json());
  for (const char* key : {"item", "frame"})
    if (place.is_object() && place.value(key, ordered_json()).is_number_unsigned())
      request[key] = place[key];
  return request;
}

/// Returns the first line of standard input, an address. Throws Error(Usage) without one.
std::string address_from_input() {
  std::string text;
  std::array<char, 512> bytes{};
  while (text.find('\n') == std::string::npos && text.size() <= kMaxAddress) {
    const ssize_t got = ::read(STDIN_FILENO, bytes.data(), bytes.size());
    if (got <= 0) break;
    text.append(bytes.data(), static_cast<size_t>(got));
  }
  text = text.substr(0, text.find('\n'));
  if (text.empty())
    throw Error(ErrorKind::Usage, "show-address: no address",
                ::isatty(STDIN_FILENO) == 1
                    ? "give one, or: lenticule web address | lenticule ctl show-address"
                    : "the command before the pipe printed none; its message has the reason");
  return text;
}

/// Returns the answer to the request. Throws the Error of an answer that is not ok, Error(Failed)
/// without an answer. Returns null if `stop_fd` became readable first.
ordered_json ask(player::ControlClient& client, const ordered_json& request,
                 std::chrono::milliseconds answer_time, int stop_fd) {
  ordered_json numbered = {{"id", 1}};
  numbered.update(request);
  client.send(numbered);
  const auto answer = client.receive(answer_time, stop_fd);
  if (!answer && stop_fd >= 0 && player::interrupted()) return nullptr;
  if (!answer)
    throw Error(ErrorKind::Failed, "ctl: no answer from the player",
                "the player may still be working on it; --wait sets how long to wait");
  if (!answer->value("ok", false)) throw_error(*answer);
  return *answer;
}

/// Shows the QR code of an address for `duration`, or until the process is interrupted, and then
/// what was shown before. Throws Error.
ExitCode show_address(const std::string& socket, const std::string& address,
                      std::chrono::milliseconds duration, std::chrono::milliseconds answer_time) {
  // A connection that stays idle may be displaced by others.
  const auto answer_to = [&](const ordered_json& request) {
    player::ControlClient client(socket, answer_time);
    return ask(client, request, answer_time, -1);
  };
  const ordered_json status = answer_to({{"do", "status"}});
  if (source_on_panel(status) == kCode)
    throw Error(ErrorKind::Failed, "show-address: the panel shows a code already",
                "wait until it ends");
  const ordered_json before = return_request(status, answer_to({{"do", "list"}}));
  (void)answer_to({{"do", "load"}, {"source", std::string(kCode) + ":" + address}});
  say("the code is on the panel for {} s, or until Ctrl-C\n", duration.count() / 1000);
  (void)player::wait_unless_interrupted(duration);
  // Another client may have loaded something else meanwhile.
  if (source_on_panel(answer_to({{"do", "status"}})) != kCode) return kOk;
  try {
    (void)answer_to(before);
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::Device) throw;
    // The list or the film may have become shorter.
    (void)answer_to({{"do", "load"}, {"source", before["source"]}});
  }
  return kOk;
}

struct CtlFlags {
  std::string socket;
  bool json = false;
  double wait_s = 60.0;
  ordered_json request = ordered_json::object();  ///< the fields that options of the verb state
  std::optional<uint64_t> events;
  std::string address;
  double seconds = 60.0;
};

std::chrono::milliseconds milliseconds_of(double seconds) {
  return std::chrono::milliseconds(static_cast<int64_t>(seconds * 1000.0));
}

std::string socket_of(const CtlFlags& flags) {
  if (!flags.socket.empty()) return flags.socket;
  const char* const from_environment = std::getenv("LENTICULE_CONTROL");
  if (from_environment != nullptr && *from_environment != '\0') return from_environment;
  return player::only_control_socket();
}

/// Prints "reading.source: a/%05d.png", one value per line.
void print_text(const ordered_json& value, const std::string& name) {
  if (value.is_object())
    for (const auto& [key, inner] : value.items())
      print_text(inner, name.empty() ? key : name + "." + key);
  else
    print_out("{}: {}\n", name,
              value.is_null()     ? "-"
              : value.is_string() ? value.get<std::string>()
                                  : json_text(value));
}

void print_answer(ordered_json answer, bool as_json) {
  answer.erase("id");
  answer.erase("ok");
  if (as_json)
    print_out("{}\n", Verbatim{json_text(answer, 2)});
  else
    print_text(answer, "");
}

/// Prints one line per event, until interrupted, the player ends, or the requested number is
/// reached.
ExitCode stream_events(player::ControlClient& client, const CtlFlags& flags) {
  uint64_t printed = 0;
  while (!flags.events || printed < *flags.events) {
    const auto event = client.receive(std::chrono::seconds(1), player::interrupt_fd());
    if (player::interrupted()) return player::interrupt_exit_code();
    if (!event) continue;
    print_out("{}\n", json_text(*event));
    flush_results();
    ++printed;
  }
  return kOk;
}

ExitCode run_ctl(const std::string& verb, const CtlFlags& flags) {
  const auto wait = milliseconds_of(flags.wait_s);
  player::ControlClient client(socket_of(flags), wait);
  ordered_json request = {{"do", verb}};
  request.update(flags.request);
  const ordered_json answer = ask(client, request, wait, player::interrupt_fd());
  if (answer.is_null()) return player::interrupt_exit_code();
  if (verb == "subscribe") return stream_events(client, flags);
  print_answer(answer, flags.json);
  return kOk;
}

/// Declares an option that states a field of the request.
template <class Value>
CLI::Option* add_field(CLI::App& app, ordered_json& request, const char* option, const char* field,
                       const char* help) {
  const auto put = [&request, field](const Value& value) { request[field] = value; };
  return app.add_option_function<Value>(option, put, help);
}

void declare_fields(CLI::App& app, std::string_view verb, CtlFlags& flags) {
  ordered_json& request = flags.request;
  const bool loads = verb == "load", opens = loads || verb == "interrupt" || verb == "cue";
  if (opens) {
    const auto put = [&request](const std::string& text) {
      if (text.empty()) throw CLI::ValidationError("SOURCE", "is empty");
      // The player may have another working folder.
      const player::SourceSpec source = player::parse_source(text);
      request["source"] = source.kind == player::SourceKind::Code
                              ? text
                              : source.in_folder(std::filesystem::current_path()).text;
    };
    app.add_option_function<std::string>("SOURCE", put,
                                         loads ? "what 'lenticule play' takes, or a list: LIST.toml"
                                               : "what 'lenticule play' takes; or --item")
        ->required(loads);
  }
  if (opens || verb == "seek") {
    add_field<uint64_t>(app, request, "--item", "item", "item of the list, counted from 0");
    add_field<uint64_t>(app, request, "--frame", "frame", "frame of the item, counted from 0");
  }
  if (verb == "interrupt") {
    add_field<double>(app, request, "--seconds", "seconds", "how much of the content")
        ->type_name("SECONDS")
        ->default_str("once");
  } else if (verb == "cue") {
    app.add_flag_callback(
        "--then-back", [&request] { request["then_back"] = true; },
        "play it once, as 'interrupt' does");
  } else if (verb == "speed") {
    add_field<double>(app, request, "FACTOR", "factor", "0.1 to 8; 1 is the content's own rate")
        ->required();
  } else if (verb == "volume") {
    add_field<double>(app, request, "DB", "db",
                      "decibels: 0 leaves the sound as it is, -80 is silence")
        ->required();
  } else if (verb == "power") {
    add_field<std::string>(app, request, "to", "to", "off: no signal; on: again, at the next frame")
        ->required()
        ->check(CLI::IsMember({"on", "off"}));
  } else if (verb == "loop") {
    const auto put = [&request](const std::string& text) {
      const auto count = number_from<uint64_t>(text);
      request["count"] = count ? ordered_json(*count) : ordered_json(text);
    };
    add_option_function(app, "COUNT N|forever", put, "a number of loops, or forever")->required();
  } else if (verb == "trim") {
    add_field<double>(app, request, "--offset", "offset", "set the offset, in lenses");
    add_field<double>(app, request, "--pitch", "pitch", "set the relative change of the pitch");
    add_field<double>(app, request, "--offset-by", "offset_by",
                      "change the offset by so many lenses, such as 0.02");
    add_field<double>(app, request, "--pitch-by", "pitch_by",
                      "change the pitch by a fraction, such as 1e-5");
  } else if (verb == "overlay") {
    const auto put_picture = [&request](const std::string& file) {
      request["picture"] = std::filesystem::absolute(file).string();
    };
    app.add_option_function<std::string>("--picture", put_picture, "picture with its alpha")
        ->type_name("FILE");
    add_field<std::string>(app, request, "--text", "text", "caption")->type_name("WORDS");
    add_field<std::string>(app, request, "--clock", "clock", "time, such as %H:%M (strftime)")
        ->type_name("FORMAT");
    add_field<std::string>(app, request, "--code", "code", "QR code of a text")->type_name("WORDS");
    add_field<std::string>(app, request, "--at", "at", "one of nine places, such as \"top left\"")
        ->type_name("PLACE")
        ->default_str("bottom right");
    add_field<double>(app, request, "--height", "height",
                      "of the picture, a line or the code, as a part of the panel's")
        ->type_name("PART");
    add_field<double>(app, request, "--for", "for_s", "then without it")->type_name("SECONDS");
    app.add_flag_callback(
        "--off", [&request] { request["off"] = true; }, "without an overlay of this command");
  } else if (verb == "snapshot") {
    const auto put = [&request](const std::string& file) {
      request["file"] = std::filesystem::absolute(file).string();
    };
    app.add_option_function<std::string>("FILE", put, "picture to write: .png, .tif, .exr or .ppm")
        ->required();
    add_triple(
        app, "--eye X,Y,Z",
        [&request](Vec3 eye) {
          request["eye"] = {eye.x, eye.y, eye.z};
        },
        "as an eye there sees it: mm right, up and away from the panel's centre");
    add_field<std::string>(app, request, "--panel", "panel", "panel of a wall, by its name")
        ->type_name("NAME");
  } else if (verb == "list") {
    add_field<uint64_t>(app, request, "--item", "item", "begin with this item, counted from 0");
  } else if (verb == "subscribe") {
    app.add_option("--count", flags.events, "end after this many events");
  }
}

struct VerbHelp {
  const char* verb;
  const char* summary;
  const char* example_arguments = "";
};

const std::vector<VerbHelp>& verb_helps() {
  static const std::vector<VerbHelp> table = {
      {"status", "print what is displayed and what comes next"},
      {"load", "play something else as soon as it is ready", "/films/city.lts"},
      {"interrupt", "play something once, then continue where it was", "/films/evacuate.lts"},
      {"back", "end an interruption or a blank panel now"},
      {"blank", "show black until 'back'"},
      {"cue", "open and decode an item for 'go'", "/films/city.lts --then-back"},
      {"go", "show the cued item at the second vblank from now"},
      {"play", "continue after a pause"},
      {"pause", "pause on the current frame"},
      {"seek", "go to a frame, or an item of the list", "--item 2 --frame 120"},
      {"next", "go to the next item"},
      {"previous", "go to the previous item"},
      {"loop", "set how often the item is played", "forever"},
      {"speed", "play at a multiple of the content's rate", "0.5"},
      {"power", "switch the output off or on", "off"},
      {"volume", "set the volume of the sound", "-- -20"},
      {"overlay", "show a text, a picture, a clock or a code over what is played",
       "--text Closed --at top --for 30"},
      {"trim", "correct drift since the calibration", "--offset-by 0.02"},
      {"snapshot", "write the displayed frame to a picture", "shown.png"},
      {"list", "print the items of the list that is played"},
      {"stats", "print the player's statistics"},
      {"doctor", "report whether subpixels reach the panel unchanged"},
      {"subscribe", "print events as they happen, one JSON object per line"},
      {"quit", "end the player cleanly"},
  };
  return table;
}

}  // namespace

Run declare_ctl(CLI::App& app) {
  const auto flags = std::make_shared<CtlFlags>();
  app.require_subcommand(1);
  add_option(app, "--socket SOCKET", flags->socket, "the player's --control socket")
      ->default_str("$LENTICULE_CONTROL, or that of the only service");
  add_option(app, "--wait SECONDS", flags->wait_s, "how long to wait for an answer")
      ->check(CLI::Range(0.01, 86400.0));
  app.add_flag("--json", flags->json, "print the answer as JSON");
  for (const auto& [verb, summary, arguments] : verb_helps()) {
    CLI::App* const sub = app.add_subcommand(verb, summary);
    sub->footer(fmt::format("Example:\n  lenticule ctl {} {}", verb, arguments));
    sub->fallthrough();  // flags of ctl may follow the verb
    declare_fields(*sub, verb, *flags);
  }
  CLI::App* const address =
      app.add_subcommand("show-address", "show the QR code of an address on the panel for a while");
  address->footer("Example:\n  lenticule ctl show-address http://192.168.1.20:8420/?t=...");
  address->fallthrough();
  address->add_option("ADDRESS", flags->address, "address of the pages with its token")
      ->default_str("a line of standard input");
  add_option(*address, "--seconds SECONDS", flags->seconds, "then show again what was shown before")
      ->check(CLI::Range(0.1, 3600.0));
  return [flags, &app, address]() -> ExitCode {
    if (address->parsed())
      return show_address(socket_of(*flags),
                          flags->address.empty() ? address_from_input() : flags->address,
                          milliseconds_of(flags->seconds), milliseconds_of(flags->wait_s));
    return run_ctl(app.get_subcommands().front()->get_name(), *flags);  // one is required
  };
}

}  // namespace lenticule::cli
