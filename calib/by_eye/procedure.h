// SPDX-License-Identifier: Apache-2.0
// Procedure is calibration by eye as a state machine: keys are the input, the chart and its text
// are the output. The state machine itself does not display, read or wait.
//
// Answers to questions determine pitch, slant and offset. The later steps check these values,
// correct them and find the gap: in each the user makes two sides look alike, and never has to
// estimate a number.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/terminal_keys.h"
#include "calib/by_eye/questions.h"
#include "frames/charts/charts.h"
#include "optics/rig.h"

namespace lenticule::calib {

enum class Step {
  Prepare,        ///< distance, warm panel, unchanged pixels
  RoughPitch,     ///< questions: bands of different pitch
  Slant,          ///< questions: columns of different slant
  Ladders,        ///< questions: ladders, for pitch, slant and offset
  Offset,         ///< left eye red, right eye green
  Check,          ///< edges against centre, all keys at once
  GapByFlips,     ///< distance between positions with equal pictures
  GapByDistance,  ///< the pitch again, from another distance
  NumberedViews,  ///< number and order of the views seen
  Save,
};
inline constexpr int kSteps = 10;

/// Changes by one press of Stride::Normal.
inline constexpr double kPitchStep = 1e-4;  ///< fraction of the pitch
inline constexpr double kSlantStepDegrees = 0.01;
inline constexpr double kOffsetStepLenses = 0.01;
inline constexpr double kSpacingStepMm = 1.0;
inline constexpr double kDistanceStepMm = 10.0;

/// ProcedureState holds everything that undo restores.
struct ProcedureState {
  Step step = Step::Prepare;
  SheetValues sheet;
  double spacing_mm = 0.0;
  double second_distance_mm = 0.0;
  double second_pitch_subpx = 0.0;
  bool second_was_seen = false;  ///< else the second pitch is predicted from the gap
  bool gap_found = false;
};

/// FirstLook is the start of the procedure: the rig, and the distance from the panel to the eye.
struct FirstLook {
  optics::Rig rig;
  double distance_mm = 0.0;
};

using frames::Chart;
using frames::ChartPattern;

/// Guide holds the instructions for one step.
struct Guide {
  std::string title;               ///< "2 of 9: slant"
  std::string task;                ///< the action, one or two sentences
  std::vector<std::string> wrong;  ///< appearance of faults, a sentence each
  std::string keys;                ///< the keys of this step
};

/// Returns the text of a step, or with `is_answered` the text after the last question; implemented
/// in guide.cpp.
[[nodiscard]] Guide guide_of(Step step, bool is_answered, double distance_mm,
                             double second_distance_mm);

/// Doubts selects the reaction to an implausible value at the end of a step (doubt_of in
/// questions.h).
enum class Doubts {
  Ask,     ///< the first enter shows the reason, the second enter accepts the value
  Refuse,  ///< the procedure ends with Status::Refused
  Accept,
};

class Procedure {
 public:
  enum class Status { Running, Saved, Left, Refused };

  /// Starts with the user's eye `distance_mm` in front of the panel, on the rig's viewing height.
  /// Throws Error(Usage) for a distance from which this rig cannot be viewed.
  Procedure(const optics::Rig& rig, double distance_mm, Doubts doubts = Doubts::Ask)
      : first_(checked(rig, distance_mm)),
        doubts_(doubts),
        questions_(rig, distance_mm),
        start_(first_state(first_)),
        state_(start_) {}

  void press(const KeyPress& press) {
    if (status_ != Status::Running) return;
    note_.clear();
    if (press.key != Key::Next) asked_.clear();
    if (is_asking() && press_question(press)) return;
    if (press.key <= Key::SlantMore) {
      if (!std::exchange(shows_old_, false)) return press_arrow(press);
      note_ = "this is the new rig again; press once more to change it";
      return;
    }
    press_control(press.key);
  }

  [[nodiscard]] Status status() const { return status_; }
  [[nodiscard]] Step step() const { return state_.step; }
  [[nodiscard]] double distance_mm() const { return first_.distance_mm; }
  /// Returns the eye's distance at this step.
  [[nodiscard]] double eye_distance_mm() const {
    return state_.step == Step::GapByDistance ? state_.second_distance_mm : first_.distance_mm;
  }

  /// Returns the edited rig with the viewing line of the original rig; always valid.
  [[nodiscard]] optics::Rig rig() const { return rig_of(state_, first_); }
  /// Returns the chart to draw now.
  [[nodiscard]] Chart chart() const {
    Chart chart{.pattern = pattern(),
                .rig = rig_seen_from(shows_old_ ? first_.rig : rig(), eye_distance_mm()),
                .cursor = cursor_,
                .magnifier = magnifier_,
                .words = {}};
    if (is_asking() && !questions_.is_done()) {
      const Question question = questions_.question();
      const optics::Rig rig = with_sheet_values(first_.rig, question.sheet, first_.distance_mm);
      chart.rig = rig_seen_from(rig, first_.distance_mm);
      chart.band_reach = question.reach;
      chart.ladder_x = question.ladder_x;
      chart.ladder_y = question.ladder_y;
      chart.words_on_top = question.ladder_y > 0.0;
    }
    if (!words_) return chart;
    const Guide words = guide();
    chart.words = {words.title + (shows_old_ ? " (OLD RIG)" : ""), words.task, words.keys,
                   numbers()};
    if (!note_.empty()) chart.words.push_back("(" + note_ + ")");
    return chart;
  }
  [[nodiscard]] Guide guide() const {
    return guide_of(state_.step, is_asking() && questions_.is_done(), first_.distance_mm,
                    state_.second_distance_mm);
  }
  /// Returns the displayed values, for example "pitch 7.7010, slant ..., step 0.0001".
  [[nodiscard]] std::string numbers() const {
    std::string text =
        (shows_old_ ? "old: " : "") + sheet_numbers(shows_old_ ? start_ : state_, first_);
    if (is_asking())
      text = fmt::format("answer {}: {}; {}", questions_.answers() + 1, mark_text(cursor_), text);
    if (state_.step == Step::GapByFlips)
      text += fmt::format("; from red to red {:.1f} mm", state_.spacing_mm);
    if (state_.step == Step::GapByDistance)
      text += fmt::format("; second distance {:.0f} mm", state_.second_distance_mm);
    return text;
  }
  /// Returns the reason why the last press had no effect, or its invisible effect; may be empty.
  [[nodiscard]] const std::string& note() const { return note_; }
  /// Returns true if the gap was calibrated, not taken from the original rig.
  [[nodiscard]] bool gap_was_found() const { return state_.gap_found; }
  /// Returns the reason why the value of this step is implausible; empty if it is plausible.
  [[nodiscard]] std::string doubt() const {
    const Limits limits = doubts_ == Doubts::Ask ? kSurprising : kImplausible;
    std::string doubt = doubt_of(first_.rig, start_.sheet, state_.sheet, limits);
    if (doubt.empty() && is_asking() && questions_.misfit() > kMostMisfitLenses)
      doubt = fmt::format(
          "the seven ladders are up to {:.2f} lens from one plane: an answer is wrong, or the "
          "sheet "
          "is not flat",
          questions_.misfit());
    return doubt;
  }
  [[nodiscard]] const Questions& questions() const { return questions_; }
  /// Returns true while charts are questions: arrows move the mark and enter answers.
  [[nodiscard]] bool is_asking() const {
    return state_.step >= Step::RoughPitch && state_.step <= Step::Ladders;
  }

 private:
  // Changes of the values by one press of a key.
  /// Two distances with a smaller ratio do not determine the gap.
  static constexpr double kLeastDistanceRatio = 1.05;
  static constexpr double kFirstSecondDistance = 1.5;

  static constexpr int kMostCoarse = 2;
  static constexpr size_t kMostUndo = 10'000;
  /// Ladders farther from one plane than this are doubtful.
  static constexpr double kMostMisfitLenses = 0.03;

  static double slant_step(const optics::Panel& panel) {
    return kSlantStepDegrees * std::numbers::pi / 180.0 * panel.pixel_height.value /
           panel.pixel_width.value;
  }

  static double gap_of_pitches(const ProcedureState& state, const FirstLook& first) {
    return gap_of_two_pitches(first.distance_mm, state.sheet.effective_pitch_subpx,
                              state.second_distance_mm, state.second_pitch_subpx);
  }

  /// Predicts the pitch from the second distance from pitch and gap, unless the user has set it. A
  /// change of the first pitch makes a new look from the second distance necessary.
  static void predict_second(ProcedureState& state, const FirstLook& first) {
    if (state.second_was_seen && state.step == Step::GapByDistance) return;
    state.second_was_seen = false;
    const double pitch =
        state.sheet.effective_pitch_subpx / (1.0 + state.sheet.gap_mm / first.distance_mm);
    state.second_pitch_subpx = pitch * (1.0 + state.sheet.gap_mm / state.second_distance_mm);
  }

  /// Returns the values of the rig. The distance is one from which the rig can be viewed.
  static ProcedureState first_state(const FirstLook& first) {
    ProcedureState state;
    state.sheet = sheet_values(first.rig, first.distance_mm);
    state.spacing_mm = spacing_of_gap(first.rig, state.sheet, first.distance_mm);
    state.second_distance_mm = kFirstSecondDistance * first.distance_mm;
    predict_second(state, first);
    return state;
  }

  /// Returns the rig with the values of a state.
  static optics::Rig rig_of(const ProcedureState& state, const FirstLook& first) {
    return with_sheet_values(first.rig, state.sheet, first.distance_mm);
  }

  /// Returns the problem of a state; empty if there is none. The rig must be valid at its viewing
  /// line and at every eye position of the procedure.
  static std::string problem_of(const ProcedureState& state, const FirstLook& first) {
    const optics::Rig rig = rig_of(state, first);
    for (const optics::Rig& seen :
         {rig_seen_from(rig, first.distance_mm), rig, rig_seen_from(rig, state.second_distance_mm)})
      if (const auto problem = optics::find_problem(seen))
        return problem->key + ": " + problem->cause;
    return "";
  }

  static void change_slant(ProcedureState& state, double presses, const FirstLook& first) {
    state.sheet.slant += presses * slant_step(first.rig.panel);
  }

  static void change_spacing(ProcedureState& state, double presses, const FirstLook& first) {
    state.spacing_mm = std::max(1.0, state.spacing_mm + presses * kSpacingStepMm);
    state.sheet.gap_mm =
        gap_of_spacing(first.rig, state.sheet, first.distance_mm, state.spacing_mm);
    state.gap_found = true;
    state.second_was_seen = false;
    predict_second(state, first);
  }

  /// Returns false, without a change, if the two distances would not determine the gap.
  static bool change_second_distance(ProcedureState& state, double presses,
                                     const FirstLook& first) {
    const double distance_mm = state.second_distance_mm + presses * kDistanceStepMm;
    const double ratio = distance_mm / first.distance_mm;
    if (!(ratio > kLeastDistanceRatio || (ratio > 0.0 && ratio < 1.0 / kLeastDistanceRatio)))
      return false;
    state.second_distance_mm = distance_mm;
    predict_second(state, first);
    if (state.second_was_seen) state.sheet.gap_mm = gap_of_pitches(state, first);
    return true;
  }

  /// Changes the second pitch. The picture from the first distance stays unchanged; the gap absorbs
  /// the difference.
  static void change_second_pitch(ProcedureState& state, double presses, const FirstLook& first) {
    state.second_pitch_subpx *= 1.0 + presses * kPitchStep;
    state.second_was_seen = true;
    state.gap_found = true;
    state.sheet.gap_mm = gap_of_pitches(state, first);
    if (state.sheet.gap_mm > 0.0)
      state.spacing_mm = spacing_of_gap(first.rig, state.sheet, first.distance_mm);
  }

  /// Swaps left and right eye by a shift of half a lens.
  static void turn_eyes(ProcedureState& state) {
    const double offset = state.sheet.effective_offset_lenses;
    state.sheet.effective_offset_lenses = offset > 0.0 ? offset - 0.5 : offset + 0.5;
  }

  static FirstLook checked(const optics::Rig& rig, double distance_mm) {
    const bool finite = std::isfinite(distance_mm) && distance_mm > 0.0;
    const auto problem = optics::find_problem(rig_seen_from(rig, finite ? distance_mm : -1.0));
    if (problem)
      throw usage_error("distance {} mm: {}: {}", distance_mm, problem->key, problem->cause)
          .remedy("give the distance from the panel to the eye in millimetres");
    return {rig, distance_mm};
  }

  static double degrees(double slant, const optics::Panel& panel) {
    return std::atan(slant * panel.pixel_width.value / panel.pixel_height.value) * 180.0 /
           std::numbers::pi;
  }

  /// Returns "effective pitch 7.7010 (pitch ...), slant ..., gap ... mm".
  static std::string sheet_numbers(const ProcedureState& state, const FirstLook& first) {
    const optics::Rig rig = rig_of(state, first);
    return fmt::format(
        "effective pitch {:.6f} (pitch {:.6f}), slant {:.4f} degrees, offset {:.4f}, gap {:.4f} mm",
        state.sheet.effective_pitch_subpx, rig.sheet.pitch.value,
        degrees(rig.sheet.slant, rig.panel), rig.sheet.offset.value, state.sheet.gap_mm);
  }

  static std::string mark_text(int cursor) {
    return cursor < 0 || cursor >= frames::kBands
               ? std::string("none of them")
               : fmt::format("band {} of {}", cursor + 1, frames::kBands);
  }
  using State = ProcedureState;

  /// Handles the keys that have another meaning while charts are questions; returns false for all
  /// others.
  bool press_question(const KeyPress& press) {
    // One, or five with shift.
    const int bands = std::max(1, static_cast<int>(presses_of(press) / 2.0));
    switch (press.key) {
      case Key::Left:
      case Key::Up:
        move_mark(-bands);
        return true;
      case Key::Right:
      case Key::Down:
        move_mark(bands);
        return true;
      case Key::Next:
        questions_.is_done() ? finish_questions() : accept_answer();
        return true;
      case Key::Back:
      case Key::Undo:
        if (questions_.undo()) {
          show_question();
          note_ = "the last answer is forgotten";
        } else {
          enter(Step::Prepare);
        }
        return true;
      case Key::Restore:
        questions_ = Questions(first_.rig, first_.distance_mm);
        show_question();
        note_ = "all answers are forgotten";
        return true;
      case Key::Magnifier:
      case Key::Words:
      case Key::Coarser:
      case Key::Finer:
      case Key::Quit:
        return false;
      default:
        note_ = "this key does nothing while you answer";
        return true;
    }
  }
  /// Moves the mark; one place beyond either end it says that no band fits.
  void move_mark(int bands) {
    cursor_ = std::clamp(cursor_ + bands, -1, frames::kBands);
    if (cursor_ < 0 || cursor_ == frames::kBands) note_ = "ENTER: none of them";
  }
  void accept_answer() {
    const bool fits = questions_.answer(cursor_);
    show_question();
    if (!fits) note_ = "this does not fit an earlier answer; please look once more";
    if (questions_.is_done()) finish_questions();
  }
  /// Goes on with the sheet of the answers. A change of the sheet by hand can be undone from here
  /// on; backspace returns to the answers.
  void finish_questions() {
    state_.sheet = questions_.values();
    if (!is_settled()) return;
    predict_second(state_, first_);
    done_.clear();
    undone_.clear();
    enter(Step::Offset);
  }
  /// Shows the next question with the mark in the middle.
  void show_question() {
    state_.sheet = questions_.values();
    cursor_ = frames::kBands / 2;
    if (questions_.is_done()) return;
    const ChartPattern pattern = questions_.question().pattern;
    state_.step = pattern == ChartPattern::Bands        ? Step::RoughPitch
                  : pattern == ChartPattern::SlantBands ? Step::Slant
                                                        : Step::Ladders;
  }
  void press_arrow(const KeyPress& press) {
    if (state_.step == Step::Prepare || state_.step == Step::Save) {
      note_ = "this key does nothing here";
      return;
    }
    const bool less =
        press.key == Key::Left || press.key == Key::Down || press.key == Key::SlantLess;
    const bool across = press.key == Key::Left || press.key == Key::Right;
    const double presses = less ? -presses_of(press) : presses_of(press);
    State state = state_;
    if (press.key == Key::SlantLess || press.key == Key::SlantMore) {
      change_slant(state, presses, first_);
    } else if (across && state.step == Step::GapByFlips) {
      change_spacing(state, presses, first_);
    } else if (across && state.step == Step::GapByDistance) {
      if (!change_second_distance(state, presses, first_)) {
        note_ = "too near to the first distance, or behind the panel";
        return;
      }
    } else if (across) {
      state.sheet.effective_offset_lenses += presses * kOffsetStepLenses;
    } else if (state.step == Step::GapByDistance) {
      change_second_pitch(state, presses, first_);
    } else {
      state.sheet.effective_pitch_subpx *= 1.0 + presses * kPitchStep;
      predict_second(state, first_);
    }
    change_to(state);
  }
  void press_control(Key key) {
    switch (key) {
      case Key::Coarser:
      case Key::Finer:
        coarseness_ =
            std::clamp(coarseness_ + (key == Key::Coarser ? 1 : -1), -kMostCoarse, kMostCoarse);
        note_ = fmt::format("steps are now {:g} times the usual size", std::pow(10.0, coarseness_));
        return;
      case Key::Next:
        return next();
      case Key::Back:
        if (state_.step != Step::Prepare) enter(static_cast<Step>(static_cast<int>(step()) - 1));
        return;
      case Key::Undo:
        shows_old_ = false;
        if (!travel(done_, undone_)) note_ = "nothing to undo";
        return;
      case Key::Redo:
        shows_old_ = false;
        if (!travel(undone_, done_)) note_ = "nothing to redo";
        return;
      case Key::Compare:
        shows_old_ = !shows_old_;
        return;
      case Key::Restore: {
        State state = start_;
        state.step = state_.step;
        if (change_to(state)) note_ = "all values of the start are restored; u undoes this";
        return;
      }
      case Key::SwapEyes: {
        State state = state_;
        turn_eyes(state);
        change_to(state);
        return;
      }
      case Key::OtherPattern:
        other_pattern_ = !other_pattern_;
        return;
      case Key::Magnifier:
        magnifier_ = !magnifier_;
        return;
      case Key::Words:
        words_ = !words_;
        return;
      default:
        status_ = Status::Left;
    }
  }

  void next() {
    const bool is_last_of_value = state_.step == Step::GapByFlips ||
                                  state_.step == Step::GapByDistance || state_.step == Step::Save;
    if (is_last_of_value && !is_settled()) return;
    if (state_.step == Step::Save) {
      status_ = Status::Saved;
      return;
    }
    enter(static_cast<Step>(static_cast<int>(state_.step) + 1));
  }
  /// Returns true if the step may end. If a value of the sheet is implausible, asks the user or
  /// ends the procedure.
  [[nodiscard]] bool is_settled() {
    const std::string doubt = this->doubt();
    if (doubt.empty() || doubts_ == Doubts::Accept || asked_ == doubt) {
      asked_.clear();
      return true;
    }
    note_ = doubt;
    if (doubts_ == Doubts::Refuse)
      status_ = Status::Refused;
    else
      note_ += "; measure again, or press ENTER once more to accept it";
    asked_ = doubt;
    return false;
  }
  void enter(Step step) {
    state_.step = step;
    if (is_asking()) show_question();
    other_pattern_ = false;
    shows_old_ = false;
  }
  /// Saves the old state for undo and sets the new one, unless the new state gives no valid rig.
  bool change_to(const State& state) {
    const std::string problem = problem_of(state, first_);
    if (!problem.empty()) {
      note_ = "limit reached: " + problem;
      return false;
    }
    if (done_.size() >= kMostUndo) done_.erase(done_.begin());
    done_.push_back(state_);
    undone_.clear();
    state_ = state;
    shows_old_ = false;
    return true;
  }
  /// Goes to the last state of `from` and saves the present one. Returns false if there is none.
  bool travel(std::vector<State>& from, std::vector<State>& to) {
    if (from.empty()) return false;
    to.push_back(state_);
    state_ = from.back();
    from.pop_back();
    return true;
  }

  [[nodiscard]] double presses_of(const KeyPress& press) const {
    const double stride = press.stride == Stride::Coarse ? 10.0
                          : press.stride == Stride::Fine ? 0.1
                                                         : 1.0;
    return stride * std::pow(10.0, coarseness_);
  }
  [[nodiscard]] ChartPattern pattern() const {
    if (is_asking())
      return questions_.is_done() ? ChartPattern::TwoViews : questions_.question().pattern;
    switch (state_.step) {
      case Step::Prepare:
        return ChartPattern::PixelLines;
      case Step::GapByDistance:
        return other_pattern_ ? ChartPattern::TwoViews : ChartPattern::Comb;
      case Step::Offset:
      case Step::Check:
      case Step::GapByFlips:
        return other_pattern_ ? ChartPattern::Comb : ChartPattern::TwoViews;
      default:
        return other_pattern_ ? ChartPattern::TwoViews : ChartPattern::NumberedViews;
    }
  }

  FirstLook first_;
  Doubts doubts_;
  Questions questions_;
  std::string asked_;  ///< the doubt that the last press of enter reported
  State start_;
  State state_;
  int cursor_ = 0;             ///< the marked band of a question
  std::vector<State> done_;    ///< states before the changes, for undo
  std::vector<State> undone_;  ///< states that were undone, the last one at the end
  int coarseness_ = 0;         ///< powers of ten
  bool shows_old_ = false;
  bool other_pattern_ = false;
  bool magnifier_ = false;
  bool words_ = true;
  Status status_ = Status::Running;
  std::string note_;
};

}  // namespace lenticule::calib
