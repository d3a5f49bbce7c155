// SPDX-License-Identifier: Apache-2.0
// lenticule calibrate by-eye calibrates a panel with the user's eye and keys.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-tools/calibrate/calibrate_result.h"
#include "apps/lenticule/cli/content_flags.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/print.h"
#include "calib/by_eye/procedure.h"
#include "calib/report/report.h"
#include "display/display_sink.h"
#include "display/open/open_display.h"
#include "frames/charts/charts.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/process/key_input.h"
#include "player/process/rig_choice.h"

namespace lenticule::tools {
namespace {

namespace fs = std::filesystem;
using calib::Procedure;
using nlohmann::json;

constexpr display::Nanoseconds kShowTimeout = std::chrono::seconds(10);
/// Longest wait for display events; a key press ends it at once.
constexpr display::Nanoseconds kNap = player::kEscapePause;

constexpr const char* kKeys =
    "You mark the best of 25 bands, columns or rungs and press enter, some 25 times. Charts with\n"
    "wrong answers come again. Then you check the values, and may change them.\n"
    "Keys:\n"
    "  arrows, or h j k l        move the mark; later what the step asks for\n"
    "  [ and ]                   change the slant\n"
    "  shift, capital H J K L    five bands, ten times as far; like page up and page down\n"
    "  ctrl                      a tenth as far\n"
    "  + and -                   make all steps ten times larger or smaller\n"
    "  enter, backspace          next step, previous step\n"
    "  u, r                      forget the last answer; undo, redo\n"
    "  space                     show the old rig, show the new one\n"
    "  escape                    forget all answers; return to the values of the start\n"
    "  i                         swap left and right eye\n"
    "  f, m, t                   other pattern, magnifier, texts on the panel\n"
    "  q                         leave without saving\n"
    "Scripts write them as left, shift+up, ctrl+right*12, [, +, enter, backspace, space, escape, "
    "u;\n"
    "text after a # is a comment.\n"
    "Example:\n"
    "  lenticule calibrate by-eye --rig kiosk.toml --display kms --distance 700 -o kiosk.toml";

struct ByEyeFlags : DisplayFlags {
  std::string rig;
  std::string output;
  std::string keys;
  std::string record;
  std::optional<double> distance_mm;
  bool insist = false;
  bool json = false;
};

std::shared_ptr<display::ScanoutRecorder> recorder_of(const ByEyeFlags& flags) {
  if (flags.record.empty()) return nullptr;
  if (display::is_kms_spec(flags.display))
    throw Error(ErrorKind::Usage, "--record: a graphics card does not report what it displayed",
                "use --display virtual");
  return display::open_recorder(flags.record);
}

display::DisplayRequest display_request(const ByEyeFlags& flags, const optics::Rig& rig) {
  display::DisplayRequest request = display::request_for(rig, flags.display);
  request.recorder = recorder_of(flags);
  request.kms.allow_inexact = flags.allow_inexact;
  return request;
}

double distance_of(const ByEyeFlags& flags, const optics::Rig& rig) {
  const double distance = flags.distance_mm.value_or(rig.viewing.distance.value);
  if (std::isinf(distance))
    throw usage_error("{}: has no viewing distance", flags.rig)
        .remedy("give the distance from the panel to the eye: --distance 700");
  return distance;
}

void set_provenance(optics::Rig& rig, const std::string& key, const std::string& text) {
  for (auto& [known, value] : rig.provenance) {
    if (known != key) continue;
    value = text;
    return;
  }
  rig.provenance.emplace_back(key, text);
}

optics::Rig result_of(const Procedure& procedure) {
  optics::Rig rig = procedure.rig();
  set_provenance(rig, "calibrated", "by eye");
  set_provenance(rig, "calibrated_at", calib::iso_utc(std::chrono::system_clock::now()));
  set_provenance(rig, "calibrated_from_mm", fmt::format("{:g}", procedure.distance_mm()));
  set_provenance(rig, "gap", procedure.gap_was_found() ? "found by eye" : "taken over");
  return rig;
}

/// Saves the rig and resets the trim beside it: the old trim was visible during the calibration and
/// is included in it, or belongs to another rig.
std::string save_keeping_old(const optics::Rig& rig, const fs::path& file) {
  const fs::path kept = optics::save_with_history(rig, file);
  optics::save_trim({}, file);
  return kept.string();
}

/// Checks that the folder is writable, before the user spends half an hour on the calibration.
void check_folder_of(const fs::path& file) {
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (access(folder.c_str(), W_OK | X_OK) == 0) return;
  throw failed_error("{}: cannot write: {}", file.string(), std::strerror(errno))
      .remedy("use an existing folder that you may write to");
}

class ByEyeRun {
 public:
  explicit ByEyeRun(const ByEyeFlags& flags)
      : flags_(flags),
        rig_(optics::load_trimmed_rig(flags.rig)),
        keys_(player::open_key_input(flags.keys)),
        procedure_(rig_, distance_of(flags, rig_), doubts()),
        request_(display_request(flags, rig_)),
        display_(display::open_display(request_)),
        sink_(*display_) {}

  ExitCode run() {
    check_folder_of(flags_.output);
    report_step();
    show();
    while (procedure_.status() == Procedure::Status::Running && !player::interrupted()) {
      const std::vector<KeyPress> presses = keys_->take();
      if (!presses.empty())
        press(presses);
      else if (keys_->at_end())
        break;
      else
        wait();
    }
    if (keys_->is_person()) say("\n");
    finish_recording();
    if (player::interrupted()) return player::interrupt_exit_code();
    return conclude();
  }

 private:
  /// Returns how to handle doubtful results: a person is asked; a script must insist in advance.
  [[nodiscard]] calib::Doubts doubts() const {
    if (flags_.insist) return calib::Doubts::Accept;
    return keys_->is_person() ? calib::Doubts::Ask : calib::Doubts::Refuse;
  }

  void press(const std::vector<KeyPress>& presses) {
    const calib::Step before = procedure_.step();
    for (const KeyPress& one : presses) procedure_.press(one);
    if (procedure_.status() != Procedure::Status::Running) return;
    if (procedure_.step() != before) report_step();
    show();
  }

  void show() {
    report_numbers();
    const frames::WovenFrame frame = frames::draw_chart(procedure_.chart());
    switch (sink_.show(frame.view(), kShowTimeout)) {
      case frames::ShowResult::Shown:
        return;
      case frames::ShowResult::TimedOut:
        throw device_error("{}: displays nothing", display_->mode().name)
            .remedy("check whether another program has the display or the panel is asleep");
      case frames::ShowResult::Lost:
        throw lost();
    }
  }

  void wait() {
    const display::DisplayEvent event = display_->wait_event(display_->now() + kNap, keys_->fd());
    if (event.kind == display::EventKind::Lost) throw lost();
  }

  [[nodiscard]] Error lost() const {
    return {ErrorKind::Device, fmt::format("{}: disconnected", display_->mode().name),
            "nothing was saved; connect it and start again"};
  }

  void report_step() const {
    const calib::Guide guide = procedure_.guide();
    if (keys_->is_person()) say("\n\n");
    say("{}\n  {}\n", guide.title, guide.task);
    for (const std::string& sentence : guide.wrong) say("  - {}\n", sentence);
    say("  {}\n", guide.keys);
  }

  /// Prints the numbers: for people one line that is overwritten, for logs a line each.
  void report_numbers() const {
    const std::string note = procedure_.note().empty() ? "" : " (" + procedure_.note() + ")";
    if (keys_->is_person())
      say("\r\x1b[K{}{}", procedure_.numbers(), note);
    else
      say("  {}{}\n", procedure_.numbers(), note);
  }

  /// Closes the display, which restores the panel, and completes the recording.
  void finish_recording() {
    display_.reset();
    if (!request_.recorder) return;
    request_.recorder->finish();
    if (const uint64_t skipped = request_.recorder->skipped(); skipped > 0)
      say("{}: {} charts were too fast to record\n", flags_.record, skipped);
  }

  ExitCode conclude() {
    if (procedure_.status() == Procedure::Status::Refused)
      throw Error(ErrorKind::Quality, "calibrate by-eye: " + procedure_.doubt(),
                  "nothing was saved; measure again, or use --insist to save the values anyway");
    const bool saved = procedure_.status() == Procedure::Status::Saved;
    const optics::Rig rig = saved ? result_of(procedure_) : rig_;
    const std::string kept = saved ? save_keeping_old(rig, flags_.output) : "";
    if (flags_.json)
      print_json(report(rig, saved, kept));
    else
      print_text(rig, saved, kept);
    if (!saved && procedure_.status() == Procedure::Status::Running)
      throw Error(ErrorKind::Failed, "calibrate by-eye: the keys ended before the rig was saved",
                  "end the script with enter at the last step, or with q");
    return kOk;
  }

  [[nodiscard]] json report(const optics::Rig& rig, bool saved, const std::string& kept) const {
    const calib::SheetValues before = calib::sheet_values(rig_, procedure_.distance_mm());
    const calib::SheetValues after = calib::sheet_values(rig, procedure_.distance_mm());
    const auto values = [](const calib::SheetValues& v, const optics::Rig& of) {
      return json{{"effective_pitch_subpx", v.effective_pitch_subpx},
                  {"pitch_subpx", of.sheet.pitch.value},
                  {"slant", v.slant},
                  {"offset_lenses", of.sheet.offset.value},
                  {"gap_mm", v.gap_mm}};
    };
    return {{"saved", saved},
            {"output", saved ? json(flags_.output) : json()},
            {"old_file_kept_as", kept.empty() ? json() : json(kept)},
            {"distance_mm", procedure_.distance_mm()},
            {"gap_found", procedure_.gap_was_found()},
            {"questions", report_of_questions()},
            {"rig_fingerprint", optics::fingerprint(rig)},
            {"before", values(before, rig_)},
            {"after", values(after, rig)}};
  }

  [[nodiscard]] json report_of_questions() const {
    const calib::Questions& questions = procedure_.questions();
    return {{"answers", questions.answers()},
            {"contradictions", questions.contradictions()},
            {"misfit_lenses", questions.misfit()}};
  }

  void print_text(const optics::Rig& rig, bool saved, const std::string& kept) const {
    if (!saved) {
      print_out("nothing was saved\n");
      return;
    }
    if (!kept.empty()) say("the old rig is kept as {}\n", kept);
    const double design = rig.viewing.distance.value;
    if (!procedure_.gap_was_found() && procedure_.distance_mm() != design)
      say("lenticule: calibrated from {:g} mm, used from {:g} mm, and the gap was not measured\n"
          "  the pitch is only as good as the gap: measure the gap too, or calibrate at the "
          "viewers' distance\n",
          procedure_.distance_mm(), design);
    print_out("{}: pitch {:.6f}, slant {:.6f}, offset {:.4f}, gap {:.4f} mm, fingerprint {}\n",
              flags_.output, rig.sheet.pitch.value, rig.sheet.slant, rig.sheet.offset.value,
              rig.sheet.gap.value, optics::fingerprint(rig));
  }

  const ByEyeFlags& flags_;
  optics::Rig rig_;
  std::unique_ptr<player::KeyInput> keys_;
  Procedure procedure_;
  display::DisplayRequest request_;
  std::unique_ptr<display::Display> display_;
  display::DisplaySink sink_;
};

}  // namespace

CalibrateWay declare_calibrate_by_eye(CLI::App& app) {
  const auto flags = std::make_shared<ByEyeFlags>();
  CLI::App* way = app.add_subcommand("by-eye",
                                     "measure the sheet with charts and keys, without a camera; "
                                     "the charts explain the steps")
                      ->group(kWithoutCamera);
  way->footer(kKeys);
  cli::declare_rig_flag(*way, flags->rig, "rig file to start from; a trim beside it is included");
  declare_display_flags(*way, *flags);
  cli::add_option(*way, "-o,--output RIG.toml", flags->output,
                  "rig file to write; an existing one is kept under a number (RIG.1.toml)")
      ->required();
  cli::add_option(*way, "--distance MM", flags->distance_mm, "distance from the panel to the eye")
      ->default_str("the rig's viewing distance");
  cli::add_option(*way, "--keys FILE", flags->keys, "file of keys to press")
      ->default_str("standard input, if that is not a terminal");
  cli::add_option(*way, "--record KIND:PATH", flags->record,
                  "with virtual: record the charts: checksums:FILE or png:FOLDER");
  way->add_flag("--insist", flags->insist, "accept implausible values without asking");
  way->add_flag("--json", flags->json, "print the result as JSON");
  return {.app = way, .run = [flags] {
            flags->rig = player::choose_rig({.given = flags->rig, .display = flags->display}).file;
            return ByEyeRun(*flags).run();
          }};
}

}  // namespace lenticule::tools
