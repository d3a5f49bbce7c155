// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/metrics.h"

#include <fmt/format.h>

#include <array>
#include <fstream>
#include <optional>

#include "base/file.h"
#include "base/numbers.h"
#include "base/text.h"

namespace lenticule::web {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct Counter {
  const char* key;
  const char* name;
  const char* help;
};

constexpr std::array<Counter, 9> kCounters = {{
    {"shown", "frames_shown_total", "Vblanks at which a new frame appeared."},
    {"vblanks", "vblanks_total", "Vblanks since the first frame."},
    {"missed_vblanks", "missed_vblanks_total", "Repeats because a flip was late."},
    {"repeated_underrun", "underrun_vblanks_total", "Repeats because no frame was ready."},
    {"dropped", "frames_dropped_total", "Frames that were late and not shown."},
    {"held", "held_vblanks_total", "Repeats while no frame was due."},
    {"damaged_frames", "frames_damaged_total", "Frames that could not be read whole."},
    {"display_returns", "display_returns_total", "Times that a lost display came back."},
    {"log_lines_dropped", "log_lines_dropped_total", "Lines that the log did not take."},
}};

std::optional<double> number_at(const ordered_json& json, const char* key) {
  return number_of(member(json, key));
}

void add(std::string& text, const char* type, const std::string& name, const std::string& help,
         const std::string& value, const std::string& labels = {}) {
  if (!help.empty())
    text += fmt::format("# HELP lenticule_{} {}\n# TYPE lenticule_{} {}\n", name, help, name, type);
  text += fmt::format("lenticule_{}{} {}\n", name, labels, value);
}

/// Returns text as the value of a label.
std::string label(const std::string& text) {
  std::string value;
  for (const char c : escaped(text)) {
    if (c == '"' || c == '\\') value += '\\';
    value += c;
  }
  return value;
}

std::optional<std::string> first_line(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  if (!std::getline(in, line) || line.size() > 200) return std::nullopt;
  return escaped(line);
}

std::optional<double> scaled(const fs::path& file, double factor) {
  const auto line = first_line(file);
  const auto value = line ? number_from<int64_t>(*line) : std::nullopt;
  return value ? std::optional(static_cast<double>(*value) * factor) : std::nullopt;
}

/// Returns the entries of a folder of the kernel whose name begins with `prefix`, in order.
std::vector<fs::path> entries(const fs::path& folder, const std::string& prefix) {
  std::vector<fs::path> found = entries_of(folder);
  std::erase_if(
      found, [&](const fs::path& entry) { return !entry.filename().string().starts_with(prefix); });
  return found;
}

void add_sentences(const ordered_json& state, const ordered_json& statistics,
                   const std::vector<MinuteFigures>& history, ordered_json& sentences) {
  const auto say = [&](const std::string& text) { sentences.push_back(text); };
  const ordered_json status = member(state, "status");
  if (state["connected"] != true) {
    say("The player does not answer: " + state["problem"].get<std::string>() + ".");
    return;
  }
  const std::string doing = text_in(status, "state"), why = text_in(status, "reason");
  if (!doing.empty() && doing != "playing" && doing != "paused")
    say(fmt::format("The player does not play; its state is: {}{}{}.", doing,
                    why.empty() ? "" : ": ", why));
  if (const std::string rig = text_in(status, "rig_problem"); !rig.empty())
    say("The rig file is not followed: " + rig + ".");
  for (const ordered_json& write : list_in(member(status, "write_problems")))
    if (const std::string cause = text_in(write, "cause"); !cause.empty())
      say("A file cannot be written: " + text_in(write, "object") + ": " + cause + ".");
  uint64_t missed = 0, late = 0;
  for (const MinuteFigures& minute : history) {
    missed += minute.missed_vblanks;
    late += minute.late_frames;
  }
  if (missed > 0)
    say(fmt::format("{} one refresh of the panel too late in the last hour.",
                    missed == 1 ? "One frame came" : fmt::format("{} frames came", missed)));
  if (late > 0)
    say(fmt::format("{} in the last hour the next frame was not ready in time.",
                    late == 1 ? "Once" : fmt::format("{} times", late)));
  if (const std::string problem = text_in(status, "last_problem"); !problem.empty())
    say("The player's last problem: " + problem + ".");
  if (number_at(statistics, "damaged_frames").value_or(0) > 0)
    say("Some frames of the content are damaged. The faults below name the files.");
  if (number_at(status, "items_skipped").value_or(0) > 0)
    say("Items of the list could not be played and were skipped. The faults below name them.");
  if (member(member(statistics, "exactness"), "exact") == "no")
    say("Subpixels do not reach the panel unchanged.");
}

}  // namespace

ordered_json machine_json(const fs::path& sys) {
  ordered_json json = {{"temperatures", ordered_json::array()}, {"clocks", ordered_json::array()}};
  for (const fs::path& zone : entries(sys / "class/thermal", "thermal_zone")) {
    const auto celsius = scaled(zone / "temp", 1e-3);
    if (celsius)
      json["temperatures"].push_back(
          {{"name", first_line(zone / "type").value_or(zone.filename().string())},
           {"celsius", *celsius}});
  }
  for (const fs::path& policy : entries(sys / "devices/system/cpu/cpufreq", "policy")) {
    const auto now = scaled(policy / "scaling_cur_freq", 1e-3);
    const auto most = scaled(policy / "cpuinfo_max_freq", 1e-3);
    if (now)
      json["clocks"].push_back({{"name", policy.filename().string()},
                                {"mhz", *now},
                                {"most_mhz", most ? ordered_json(*most) : ordered_json(nullptr)}});
  }
  return json;
}

std::string metrics_text(const PlayerState& player) {
  const ordered_json state = player.state();
  const ordered_json statistics = player.statistics();
  const bool connected = state["connected"] == true;
  std::string text;
  add(text, "gauge", "up", "1 if the player answers.", connected ? "1" : "0");
  if (connected) {
    add(text, "gauge", "state", "The state of the player.", "1",
        fmt::format("{{state=\"{}\"}}", label(text_in(state["status"], "state"))));
  }
  for (const Counter& counter : kCounters)
    if (const auto value = number_at(statistics, counter.key))
      add(text, "counter", counter.name, counter.help, fmt::format("{}", *value));
  for (const auto& [key, name] : {std::pair("submit_to_flip_us", "submit_to_flip"),
                                  {"wake_latency_us", "wake_latency"},
                                  {"copy_us", "copy"}}) {
    const ordered_json times = member(statistics, key);
    std::string help = "Time in seconds, by quantile; 1 is the largest.";
    for (const auto& [part, quantile] : {std::pair("p50", "0.5"), {"p99", "0.99"}, {"max", "1"}}) {
      if (const auto value = number_at(times, part))
        add(text, "gauge", fmt::format("{}_seconds", name), std::exchange(help, {}),
            fmt::format("{}", *value * 1e-6), fmt::format("{{quantile=\"{}\"}}", quantile));
    }
  }
  if (const auto bytes = number_at(member(statistics, "resident_bytes"), "total"))
    add(text, "gauge", "resident_bytes", "Memory of the player.", fmt::format("{}", *bytes));
  std::string help = "Temperature that the kernel reports.";
  for (const ordered_json& sensor : machine_json()["temperatures"])
    add(text, "gauge", "machine_celsius", std::exchange(help, {}),
        fmt::format("{}", sensor["celsius"].get<double>()),
        fmt::format("{{sensor=\"{}\"}}", label(sensor["name"].get<std::string>())));
  return text;
}

ordered_json health_json(const PlayerState& player) {
  const ordered_json state = player.state();
  const ordered_json statistics = player.statistics();
  const std::vector<MinuteFigures> history = player.history();
  ordered_json json = {{"connected", state["connected"]},
                       {"verdict", "good"},
                       {"sentences", ordered_json::array()},
                       {"display", member(statistics, "display")},
                       {"exactness", member(statistics, "exactness")},
                       {"figures", ordered_json::object()},
                       {"history", ordered_json::array()},
                       {"faults", player.faults()},
                       {"machine", machine_json()}};
  for (const Counter& counter : kCounters)
    if (statistics.is_object() && statistics.contains(counter.key))
      json["figures"][counter.key] = statistics[counter.key];
  add_sentences(state, statistics, history, json["sentences"]);
  if (!json["sentences"].empty()) json["verdict"] = state["connected"] == true ? "look" : "bad";
  for (const MinuteFigures& minute : history)
    json["history"].push_back({{"time", minute.minute * 60},
                               {"vblanks", minute.vblanks},
                               {"missed_vblanks", minute.missed_vblanks},
                               {"late_frames", minute.late_frames}});
  return json;
}

}  // namespace lenticule::web
