// SPDX-License-Identifier: Apache-2.0
// lenticule-web serves pages and an HTTP API for a player that runs with --control.
#include <fmt/format.h>
#include <poll.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "apps/lenticule-web/api/metrics.h"
#include "apps/lenticule-web/api/web_site.h"
#include "apps/lenticule-web/http/server.h"
#include "base/error_kinds.h"
#include "base/file.h"
#include "base/installation.h"
#include "base/main_function.h"
#include "base/print.h"
#include "frames/qr/qr_code.h"

namespace lenticule::web {
namespace {

namespace fs = std::filesystem;

constexpr ErrorStyle kErrors{.program = "lenticule web"};
constexpr int kTextfileEvery_ms = 15'000;
/// File of the state folder with the address at which the server listens.
constexpr const char* kAddressFile = "address";
constexpr const char* kUsualAddress = "http://127.0.0.1:8420";

struct Flags {
  std::string socket;
  std::vector<std::string> listen;
  std::string unix_socket;
  bool lan = false;
  std::string state;
  std::string media;
  double media_limit_gib = 64.0;
  std::string textfile;
  std::string token_name;
  std::string rights = "change";
  std::string token_id;
  std::string base;
  bool code = false;
};

std::string from_environment(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? std::string() : value;
}

/// Returns the folder of the server's own files: --state, what the service manager names, or one in
/// the user's home.
fs::path state_folder(const Flags& flags) {
  fs::path folder = flags.state;
  if (folder.empty()) folder = from_environment("STATE_DIRECTORY");
  if (folder.empty()) {
    const std::string state = from_environment("XDG_STATE_HOME");
    const std::string home = from_environment("HOME");
    if (state.empty() && home.empty())
      throw Error(ErrorKind::Usage, "--state: missing", "name a folder for the tokens");
    folder = (state.empty() ? fs::path(home) / ".local/state" : fs::path(state)) / "lenticule-web";
  }
  std::error_code error;
  if (fs::create_directories(folder, error)) fs::permissions(folder, fs::perms::owner_all, error);
  if (!fs::is_directory(folder)) throw failed_error("{}: cannot be created", folder.string());
  return folder;
}

std::string control_socket(const Flags& flags) {
  if (!flags.socket.empty()) return flags.socket;
  if (const std::string socket = from_environment("LENTICULE_CONTROL"); !socket.empty())
    return socket;
  throw Error(ErrorKind::Usage, "--socket: missing",
              "name the player's control socket: --socket /run/lenticule/NAME/control.sock");
}

std::vector<Listener> open_listeners(const Flags& flags) {
  std::vector<Listener> listeners = passed_listeners(flags.lan);
  for (const std::string& address : flags.listen)
    listeners.push_back(listen_tcp(parse_listen_address(address), flags.lan));
  if (!flags.unix_socket.empty()) listeners.push_back(listen_unix(flags.unix_socket));
  if (listeners.empty())
    listeners.push_back(listen_tcp({.host = "127.0.0.1", .port = 8420}, flags.lan));
  return listeners;
}

/// Writes the address that `lenticule web address` prints. A disk that is full must not prevent the
/// server from starting.
void write_address(const fs::path& state, const std::vector<Listener>& listeners) {
  const auto tcp = std::ranges::find(listeners, false, &Listener::is_unix);
  const std::string name = tcp == listeners.end() ? "" : reachable_names(*tcp).front();
  std::error_code ignored;
  fs::remove(state / kAddressFile, ignored);  // an earlier server's
  try {
    write_text_file(state / kAddressFile, name.empty() ? "" : "http://" + name + "\n");
  } catch (const Error& error) {
    say("{}; use lenticule web address --base\n", error.what());
  }
}

/// Returns the beginning of the address: --base, or where the server of the state folder listens.
std::string base_of(const Flags& flags) {
  if (!flags.base.empty()) return flags.base;
  const fs::path file = state_folder(flags) / kAddressFile;
  const std::string text = fs::exists(file) ? read_text_file(file, 4096) : std::string();
  return text.empty() ? kUsualAddress : text.substr(0, text.find('\n'));
}

void write_textfile(const Flags& flags, const WebSite& site, bool& failed) {
  if (flags.textfile.empty()) return;
  try {
    write_text_file(flags.textfile, metrics_text(const_cast<WebSite&>(site).player()));
    failed = false;
  } catch (const Error& error) {
    if (!failed) say("{}; trying again\n", error.what());
    failed = true;
  }
}

std::string address_of(const std::string& base, const Token& token) {
  return fmt::format("{}/enter?token={}", base, token.secret);
}

bool is_terminal() { return ::isatty(STDOUT_FILENO) == 1; }

/// Prints the address, and its QR code if people look at the output.
void print_address(const std::string& address, bool code) {
  print_out("{}\n", address);
  if (code) print_out("{}", Verbatim{frames::qr_terminal_text(frames::qr_code_of(address))});
}

int serve(const Flags& flags) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, number);
  sigprocmask(SIG_BLOCK, &signals, nullptr);  // before the first thread, which inherits the mask
  const UniqueFd stop(::signalfd(-1, &signals, SFD_CLOEXEC));

  const fs::path state = state_folder(flags);
  const fs::path tokens = state / "tokens.json";
  if (read_tokens(tokens).empty()) (void)add_token(tokens, "first", Rights::Change);
  Access access(tokens);
  WebSite site(
      {.socket = control_socket(flags),
       .state = state,
       .media = {.folder = flags.media,
                 .largest_file = static_cast<uint64_t>(flags.media_limit_gib * 1073741824.0)},
       .program = find_sibling_program("lenticule").value_or("lenticule")});
  std::vector<Listener> listeners = open_listeners(flags);
  for (const Listener& listener : listeners) {
    say("listening at {}{}{}\n", listener.name,
        is_terminal() ? "" : "; lenticule web address prints the address with its token",
        listener.is_local ? "" : "; other machines can reach it, and HTTP is not encrypted");
    if (listener.is_unix || !is_terminal()) continue;
    for (const std::string& name : reachable_names(listener))
      print_address(address_of("http://" + name, read_tokens(tokens).front()), true);
  }
  write_address(state, listeners);
  flush_results();
  const Server server(std::move(listeners), site, access);
  bool textfile_failed = false;
  pollfd entry{.fd = stop.get(), .events = POLLIN, .revents = 0};
  do {
    write_textfile(flags, site, textfile_failed);
  } while (poll(&entry, 1, kTextfileEvery_ms) <= 0);
  site.stop();
  return kOk;
}

int print_tokens(const Flags& flags) {
  for (const Token& token : read_tokens(state_folder(flags) / "tokens.json"))
    print_out("{}  {:6}  {}  {}\n", token.id, rights_name(token.rights), token.made, token.name);
  return kOk;
}

void print_address(const Flags& flags, const Token& token) {
  print_address(address_of(base_of(flags), token), flags.code || is_terminal());
}

int add(const Flags& flags) {
  const auto rights = rights_named(flags.rights);
  if (!rights)
    throw usage_error("--rights '{}': unknown", flags.rights).remedy("expected see or change");
  print_address(flags, add_token(state_folder(flags) / "tokens.json", flags.token_name, *rights));
  return kOk;
}

int revoke(const Flags& flags) {
  revoke_token(state_folder(flags) / "tokens.json", flags.token_id);
  return kOk;
}

int print_addresses(const Flags& flags) {
  const fs::path file = state_folder(flags) / "tokens.json";
  const std::vector<Token> tokens = read_tokens(file);
  if (tokens.empty())
    throw Error(
        ErrorKind::Failed, file.string() + ": no tokens yet",
        "the first start of the server makes one; name that server's folder with --state; or: "
        "lenticule web token add NAME");
  for (const Token& token : tokens) print_address(flags, token);
  return kOk;
}

int run(int argc, char** argv) {
  if (const int failed = prepare_program(kErrors); failed != kOk) return failed;
  Flags flags;
  CLI::App app("Serves pages on which a phone or a browser controls and watches a player.",
               "lenticule web");
  app.footer(
      "Example:\n  lenticule web --socket /run/lenticule/lobby/control.sock "
      "--media /var/lib/lenticule/media");
  app.set_version_flag("--version", LENTICULE_VERSION);
  app.add_option("--socket", flags.socket,
                 "the player's --control socket (default: $LENTICULE_CONTROL)");
  app.add_option("--listen", flags.listen,
                 "numeric address and port (default: 127.0.0.1:8420); may be repeated");
  app.add_option("--unix", flags.unix_socket, "a Unix socket, for a reverse proxy");
  app.add_flag("--lan", flags.lan, "permit addresses that other machines can reach");
  app.add_option(
      "--state", flags.state,
      "folder of the tokens (default: $STATE_DIRECTORY, or ~/.local/state/lenticule-web)");
  app.add_option("--media", flags.media, "folder of the content: uploads, and the list");
  app.add_option("--media-limit", flags.media_limit_gib, "largest file in GiB")
      ->check(CLI::Range(0.001, 65536.0))
      ->capture_default_str();
  app.add_option("--textfile", flags.textfile,
                 "write the metrics to this file, for the textfile collector of node_exporter");
  CLI::App* const token = app.add_subcommand("token", "list, add and revoke tokens");
  token->require_subcommand(1)->fallthrough();
  CLI::App* const list = token->add_subcommand("list", "print id, rights, date and name");
  CLI::App* const added = token->add_subcommand("add", "add a token and print its address");
  added->add_option("name", flags.token_name, "who gets it")->required();
  added->add_option("--rights", flags.rights, "see or change")->capture_default_str();
  CLI::App* const revoked = token->add_subcommand("revoke", "revoke a token and its cookies");
  revoked->add_option("id", flags.token_id, "as 'token list' prints it")->required();
  CLI::App* const address = app.add_subcommand(
      "address", "print the addresses with their tokens; --state as for the server");
  for (CLI::App* const sub : {list, added, revoked, address}) sub->fallthrough();
  token->footer("Example:\n  lenticule web token add museum --rights see");
  added->footer(
      "Example:\n  lenticule web token add museum --rights see --base http://kiosk.local:8420");
  revoked->footer("Example:\n  lenticule web token revoke 1f0c3a9e");
  address->footer("Example:\n  lenticule web address --base http://kiosk.local:8420 --code");
  for (CLI::App* const sub : {added, address}) {
    sub->add_option("--base", flags.base, "beginning of the address")
        ->default_str("where the server of this state folder listens");
    sub->add_flag("--code", flags.code,
                  "print the QR code of the address, also if the output is not a terminal");
  }
  if (const auto code = parse_arguments<CLI::ParseError>(app, argc, argv, kErrors)) return *code;
  return run_reporting_errors(
      [&]() -> int {
        if (list->parsed()) return print_tokens(flags);
        if (added->parsed()) return add(flags);
        if (revoked->parsed()) return revoke(flags);
        if (address->parsed()) return print_addresses(flags);
        return serve(flags);
      },
      kErrors);
}

}  // namespace
}  // namespace lenticule::web

int main(int argc, char** argv) { return lenticule::web::run(argc, argv); }
