// SPDX-License-Identifier: Apache-2.0
#include "calib/by_eye/procedure.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "calib/by_eye/step_display.h"

namespace lenticule::calib {
namespace {

using frames::kBands;

constexpr int kMostCoarse = 2;
/// Ladders farther from one plane than this are doubtful.
constexpr double kMostMisfitLenses = 0.03;

}  // namespace

Procedure::Procedure(const optics::Rig& rig, double distance_mm, Doubts doubts, Way way)
    : first_{rig, distance_mm}, doubts_(doubts) {
  const bool finite = std::isfinite(distance_mm) && distance_mm > 0.0;
  const auto problem = optics::find_problem(rig_seen_from(rig, finite ? distance_mm : -1.0));
  if (problem)
    throw Error(ErrorKind::Usage,
                fmt::format("distance {} mm: {}: {}", distance_mm, problem->key, problem->cause),
                "give the distance from the panel to the eye in millimetres");
  start_ = first_state(first_);
  state_ = start_;
  if (way == Way::Questions) questions_.emplace(rig, distance_mm);
}

// --- keys -------------------------------------------------------------------------------------

void Procedure::press(const KeyPress& press) {
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

double Procedure::presses_of(const KeyPress& press) const {
  const double stride = press.stride == Stride::Coarse ? 10.0
                        : press.stride == Stride::Fine ? 0.1
                                                       : 1.0;
  return stride * std::pow(10.0, coarseness_);
}

void Procedure::press_arrow(const KeyPress& press) {
  const double presses = presses_of(press);
  switch (press.key) {
    case Key::Left:
      return move_across(-presses);
    case Key::Right:
      return move_across(presses);
    case Key::Up:
      return move_upward(presses);
    case Key::Down:
      return move_upward(-presses);
    case Key::SlantLess:
      return turn_lenses(-presses);
    default:
      return turn_lenses(presses);
  }
}

void Procedure::press_control(Key key) {
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
      if (!history_.undo(state_)) note_ = "nothing to undo";
      return;
    case Key::Redo:
      shows_old_ = false;
      if (!history_.redo(state_)) note_ = "nothing to redo";
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

void Procedure::move_across(double presses) {
  State state = state_;
  switch (state_.step) {
    case Step::Prepare:
    case Step::RoughPitch:
    case Step::Save:
      note_ = "left and right do nothing here";
      return;
    case Step::Slant:
      return turn_lenses(presses);
    case Step::GapByFlips:
      change_spacing(state, presses, first_);
      break;
    case Step::GapByDistance:
      if (!change_second_distance(state, presses, first_)) {
        note_ = "too near to the first distance, or behind the panel";
        return;
      }
      break;
    default:
      state.sheet.effective_offset_lenses += presses * kOffsetStepLenses;
  }
  change_to(state);
}

/// Returns the bands that the mark moves: one, or five with shift.
int Procedure::bands_of(double presses) const {
  const int bands = std::max(1, static_cast<int>(std::abs(presses) / 2.0));
  return presses > 0.0 ? bands : -bands;
}

void Procedure::move_upward(double presses) {
  State state = state_;
  switch (state_.step) {
    case Step::Prepare:
    case Step::Save:
      note_ = "up and down do nothing here";
      return;
    case Step::RoughPitch: {
      // The bands' pitches grow downward, but the "up" key moves up on the panel.
      state.cursor = std::clamp(state.cursor - bands_of(presses), 0, kBands - 1);
      break;
    }
    case Step::GapByDistance:
      change_second_pitch(state, presses, first_);
      break;
    default:
      state.sheet.effective_pitch_subpx *= 1.0 + presses * kPitchStep;
      predict_second(state, first_);
  }
  change_to(state);
}

void Procedure::turn_lenses(double presses) {
  if (state_.step < Step::Slant || state_.step == Step::Save) {
    note_ = "the slant can be changed after the rough pitch";
    return;
  }
  State state = state_;
  change_slant(state, presses, first_);
  change_to(state);
}

// --- questions --------------------------------------------------------------------------------

bool Procedure::is_asking() const {
  return questions_ && state_.step >= Step::RoughPitch && state_.step <= Step::Pitch;
}

/// Handles the keys that have another meaning while charts are questions; returns false for all
/// others.
bool Procedure::press_question(const KeyPress& press) {
  const int bands = bands_of(presses_of(press));
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
      questions_->is_done() ? finish_questions() : take_answer();
      return true;
    case Key::Back:
    case Key::Undo:
      if (questions_->undo()) {
        show_question();
        note_ = "the last answer is forgotten";
      } else {
        enter(Step::Prepare);
      }
      return true;
    case Key::Restore:
      questions_.emplace(first_.rig, first_.distance_mm);
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
void Procedure::move_mark(int bands) {
  state_.cursor = std::clamp(state_.cursor + bands, -1, kBands);
  if (state_.cursor < 0 || state_.cursor == kBands) note_ = "ENTER: none of them";
}

void Procedure::take_answer() {
  const bool fits = questions_->answer(state_.cursor);
  show_question();
  if (!fits) note_ = "this does not fit an earlier answer; please look once more";
  if (questions_->is_done()) finish_questions();
}

/// Shows the next question with the mark in the middle.
void Procedure::show_question() {
  state_.sheet = questions_->values();
  state_.cursor = kBands / 2;
  if (questions_->is_done()) return;
  const ChartPattern pattern = questions_->question().pattern;
  state_.step = pattern == ChartPattern::Bands        ? Step::RoughPitch
                : pattern == ChartPattern::SlantBands ? Step::Slant
                                                      : Step::Pitch;
}

/// Goes on with the sheet of the answers. A change of the sheet by hand can be undone from here on;
/// backspace returns to the answers.
void Procedure::finish_questions() {
  state_.sheet = questions_->values();
  if (!is_settled()) return;
  predict_second(state_, first_);
  history_.clear();
  enter(Step::Offset);
}

// --- steps and history ------------------------------------------------------------------------

std::string Procedure::doubt() const {
  const Limits limits = doubts_ == Doubts::Ask ? kSurprising : kImplausible;
  std::string doubt = doubt_of(first_.rig, start_.sheet, state_.sheet, limits);
  if (doubt.empty() && is_asking() && questions_->misfit() > kMostMisfitLenses)
    doubt = fmt::format(
        "the seven ladders are up to {:.2f} lens from one plane: an answer is wrong, or the sheet "
        "is not flat",
        questions_->misfit());
  return doubt;
}

/// Returns true if the step may end. If a value of the sheet is implausible, asks the user or ends
/// the procedure.
bool Procedure::is_settled() {
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

void Procedure::next() {
  const bool is_last_of_value = state_.step == Step::Pitch || state_.step == Step::Slant ||
                                state_.step == Step::GapByFlips ||
                                state_.step == Step::GapByDistance || state_.step == Step::Save;
  if (is_last_of_value && !is_settled()) return;
  if (state_.step == Step::Save) {
    status_ = Status::Saved;
    return;
  }
  if (state_.step == Step::RoughPitch) return take_marked_band();
  enter(static_cast<Step>(static_cast<int>(state_.step) + 1));
}

/// Takes the marked band's pitch; then repeats the choice among pitches ten times as close.
void Procedure::take_marked_band() {
  State state = state_;
  const bool again = take_band(state, first_);
  if (change_to(state) && !again) enter(Step::Slant);
}

void Procedure::enter(Step step) {
  state_.step = step;
  if (is_asking()) show_question();
  other_pattern_ = false;
  shows_old_ = false;
}

bool Procedure::change_to(const State& state) {
  const std::string problem = problem_of(state, first_);
  if (!problem.empty()) {
    note_ = "limit reached: " + problem;
    return false;
  }
  history_.add(state_);
  state_ = state;
  shows_old_ = false;
  return true;
}

// --- results ----------------------------------------------------------------------------------

optics::Rig Procedure::rig() const {
  return rig_of(state_, first_);
}

double Procedure::eye_distance_mm() const {
  return state_.step == Step::GapByDistance ? state_.second_distance_mm : first_.distance_mm;
}

ChartPattern Procedure::pattern() const {
  if (is_asking())
    return questions_->is_done() ? ChartPattern::TwoViews : questions_->question().pattern;
  return pattern_of_step(state_.step, other_pattern_);
}

Chart Procedure::chart() const {
  Chart chart{.pattern = pattern(),
              .rig = rig_seen_from(shows_old_ ? first_.rig : rig(), eye_distance_mm()),
              .band_reach = state_.band_reach,
              .cursor = state_.cursor,
              .lens_lines = state_.step == Step::Slant,
              .magnifier = magnifier_,
              .words = {}};
  if (is_asking() && !questions_->is_done()) {
    const Question question = questions_->question();
    const optics::Rig rig = with_sheet_values(first_.rig, question.sheet, first_.distance_mm);
    chart.rig = rig_seen_from(rig, first_.distance_mm);
    chart.band_reach = question.reach;
    chart.ladder_x = question.ladder_x;
    chart.ladder_y = question.ladder_y;
    chart.lens_lines = false;
    chart.words_on_top = question.ladder_y > 0.0;
  }
  if (!words_) return chart;
  const Guide words = guide();
  chart.words = {words.title + (shows_old_ ? " (OLD RIG)" : ""), words.task, words.keys, numbers()};
  if (!note_.empty()) chart.words.push_back("(" + note_ + ")");
  return chart;
}

Guide Procedure::guide() const {
  if (is_asking()) return guide_of_question(state_.step, pattern());
  return guide_of(state_.step, first_.distance_mm, state_.second_distance_mm);
}

std::string Procedure::numbers() const {
  std::string text =
      (shows_old_ ? "old: " : "") + sheet_numbers(shows_old_ ? start_ : state_, first_);
  if (is_asking())
    text =
        fmt::format("answer {}: {}; {}", questions_->answers() + 1, mark_text(state_.cursor), text);
  else if (state_.step == Step::RoughPitch)
    text += "; " + mark_text(state_.cursor);
  if (state_.step == Step::GapByFlips)
    text += fmt::format("; from red to red {:.1f} mm", state_.spacing_mm);
  if (state_.step == Step::GapByDistance)
    text += fmt::format("; second distance {:.0f} mm", state_.second_distance_mm);
  return text;
}

}  // namespace lenticule::calib
