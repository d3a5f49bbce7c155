// SPDX-License-Identifier: Apache-2.0
// Texts of calibration by eye, the same on the panel and on the terminal. Plain ASCII, because the
// panel's font has no other characters.
#include <fmt/format.h>

#include "calib/by_eye/procedure.h"

namespace lenticule::calib {
namespace {

struct Words {
  const char* name;
  const char* task;  ///< {0} is the distance, {1} the second one, both in millimetres
  std::vector<const char*> wrong;
  const char* keys;
};

constexpr const char* kQuestionKeys =
    "ENTER: answer, U: forget the last answer, SHIFT: five at once, T: hide this text";

/// Returns the words of all steps, in the order of Step.
const std::vector<Words>& words_of_steps() {
  static const std::vector<Words> words = {
      {"before you begin",
       "Put one eye {0:.0f} mm from the panel, in front of the panel's middle, and keep your head "
       "still. The panel should have been on for half an hour.",
       {"The lines of one pixel are red, green and blue in turn, upright on the left and flat on "
        "the right. Where they are grey, blurred or in waves, the picture is scaled or its colours "
        "are averaged: no calibration can help before that is fixed."},
       "ENTER: continue"},
      {"rough pitch",
       "UP DOWN: mark the band with the fewest and broadest stripes, alike on the left and on the "
       "right.",
       {"Several bands are equally good: mark the middle one.",
        "The stripes get fewer all the way to the top or to the bottom: move the mark beyond the "
        "end, for none of them.",
        "A wrong answer does no harm: charts come again until the answers agree."},
       kQuestionKeys},
      {"slant",
       "LEFT RIGHT: mark the column with the fewest stripes from top to bottom.",
       {"Several columns are equally good: mark the middle one.",
        "The stripes get fewer all the way to the left or to the right: move the mark beyond the "
        "end, for none of them.",
        "Dark columns without stripes count as well."},
       kQuestionKeys},
      {"ladders",
       "UP DOWN: mark the rung where red above turns into green below. Stay in front of the "
       "panel's middle with one eye.",
       {"Several rungs are equally yellow: mark the middle one.",
        "No red above green, only one colour, or stripes: move the mark beyond the end, for none.",
        "Each of the seven ladders comes at least twice."},
       kQuestionKeys},
      {"offset",
       "Hold your nose in front of the panel's middle and close one eye after the other: the "
       "left eye should see only red, the right eye only green.",
       {"One eye sees both colours in the middle: the offset is off; move the offset toward the "
        "side where the colours are clean.",
        "The left eye sees green and the right one red: press I.",
        "It stays swapped however you move: the panel shows its picture mirrored."},
       "LEFT RIGHT: offset, I: swap the eyes"},
      {"check",
       "Close one eye and move your head slowly sideways: everywhere on the panel red should "
       "turn into green at the same moment.",
       {"One edge turns too early and the other too late: correct the pitch with UP or DOWN; or "
        "your distance is not {0:.0f} mm.",
        "The whole panel turns at once, but not when your eye is in the middle: correct the "
        "offset with LEFT or RIGHT.",
        "The top turns before the bottom: correct the slant with [ or ].",
        "Only some patches are off: the sheet is not flat there. This procedure cannot correct "
        "that; calibrate with a camera."},
       "UP DOWN: pitch, LEFT RIGHT: offset, [ ]: slant"},
      {"gap, by the viewing zones",
       "At {0:.0f} mm, with one eye, move sideways and note where the panel's middle turns from "
       "red to green to your left, and the next place to your right where it does so again. "
       "Enter their distance. ENTER alone keeps the gap as it is.",
       {"Wrong gap: at {0:.0f} mm the picture is right, but seen from nearer or farther the "
        "edges differ in colour from the middle, and depth is too strong or too weak."},
       "LEFT RIGHT: distance from red-to-green to red-to-green"},
      {"gap, by a second distance",
       "Move your eye to {1:.0f} mm and make the panel one colour again, as for the pitch. "
       "ENTER alone keeps the gap as it is.",
       {"Wrong gap: stripes that had disappeared at {0:.0f} mm are visible here.",
        "What you change here leaves the picture at {0:.0f} mm as it is.",
        "The middle is dark: you are not in front of it; move your head, not the picture."},
       "UP DOWN: remove the stripes, LEFT RIGHT: this distance, F: red and green"},
      {"views by their numbers",
       "One eye sees one number all over the panel. Moving to the right it counts up, and at "
       "the end of the zone it starts again at 0.",
       {"Different numbers on the left and on the right: the pitch is off, or your distance is.",
        "Two numbers at once everywhere: you are between two views, or the offset is off.",
        "It counts down: the panel shows its picture mirrored."},
       "UP DOWN: pitch, LEFT RIGHT: offset, [ ]: slant"},
      {"save",
       "SPACE shows the old rig and the new one. If the new one is better, ENTER saves it.",
       {"The old one is better: ESCAPE restores it, BACKSPACE returns to the previous step."},
       "SPACE: old and new, ENTER: save, ESCAPE: restore, Q: leave without saving"}};
  return words;
}

/// Returns the words after the last question.
const Words& words_after_questions() {
  static const Words words = {
      "answered",
      "All questions are answered. The panel should be equally yellow for one eye in front of its "
      "middle.",
      {"Something is wrong: U forgets the last answer, ESCAPE all of them."},
      "ENTER: continue, U: forget the last answer, ESCAPE: begin again"};
  return words;
}

}  // namespace

Guide guide_of(Step step, bool is_answered, double distance_mm, double second_distance_mm) {
  const auto number = static_cast<size_t>(step);
  const Words& words = is_answered ? words_after_questions() : words_of_steps().at(number);
  const auto filled = [&](const char* text) {
    return fmt::format(fmt::runtime(text), distance_mm, second_distance_mm);
  };
  Guide guide{.title = fmt::format("{} of {}: {}", number, kSteps - 1, words.name),
              .task = filled(words.task),
              .wrong = {},
              .keys = words.keys};
  for (const char* sentence : words.wrong) guide.wrong.push_back(filled(sentence));
  return guide;
}

}  // namespace lenticule::calib
