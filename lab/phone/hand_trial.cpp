// SPDX-License-Identifier: Apache-2.0
#include "lab/phone/hand_trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "apps/lenticule-tools/calibrate/hand_held_photos.h"
#include "calib/phone/exif.h"
#include "frames/srgb.h"
#include "optics/rig_file.h"

namespace lenticule::lab {

HandTrial::HandTrial(uint64_t seed, const WorkshopLimits& limits, std::filesystem::path pictures)
    : pictures_(std::move(pictures)),
      workshop_(draw_workshop(seed, limits)),
      sheet_(workshop_.start.panel, workshop_.build),
      chart_(calib::plan_single_photo_chart(workshop_.start)) {
  take(workshop_.shots.front());
  // The owner obeys the program, which asks for a new start if the pitch is far off.
  if (const auto better = calib::better_start(photos_.front().findings, chart_)) {
    chart_ = calib::plan_single_photo_chart(*better);
    photos_.clear();
    take(workshop_.shots.front());
  }
  for (size_t n = 1; n < workshop_.shots.size(); ++n) take(workshop_.shots[n]);
}

void HandTrial::take(const Shot& shot) {
  const frames::WovenFrame shown = draw_single_photo_chart(chart_);
  Photo photo = photograph(sheet_, shown.view(), workshop_.phone, shot);
  if (!pictures_.empty()) {
    std::filesystem::create_directories(pictures_);
    write_photo(photo, workshop_.phone.jpeg_quality,
                pictures_ / fmt::format("{}.jpg", photos_.size() + 1));
    optics::save_rig(chart_.start, pictures_ / "start.toml");
  }
  round_trip(photo, workshop_.phone.jpeg_quality);
  focal_px_ = calib::focal_of_film(photo.stated_focal_35mm, photo.width);
  calib::CameraPicture picture = picture_of(photo);
  photos_.push_back({.name = "photograph " + std::to_string(photos_.size() + 1),
                     .findings = calib::measure_hand_held(picture, chart_, focal_px_)});
  if (photos_.size() == 1) first_picture_ = std::move(picture);
}

double HandTrial::error_of(const optics::Rig& rig) const {
  return worst_error(rig, sheet_, judged_eyes(workshop_.start));
}

HandResult HandTrial::calibrate(int photographs) const {
  const bool single = photographs == 1;
  const calib::Calibration found =
      single ? calib::fit_single_photo(first_picture_, chart_,
                                       {.focal_px = focal_px_, .distance_mm = std::nullopt})
             : calib::calibrate_phone({photos_.begin(), photos_.begin() + photographs}, chart_,
                                      focal_px_);
  const bool refused = found.verdict == calib::Verdict::Refused;
  HandResult out;
  out.photographs = photographs;
  out.reasons = found.reasons;
  // Why photographs were not used.
  out.reasons.insert(out.reasons.end(), found.warnings.begin(), found.warnings.end());
  out.fit_seconds = found.seconds_computing;
  out.fitted = single ? !refused : !found.viewpoints.empty() && !optics::find_problem(found.rig);
  if (!out.fitted) return out;
  out.error_lenses = single ? worst_error(found.rig, sheet_, {workshop_.shots.front().eye_mm})
                            : error_of(found.rig);
  out.stated_lenses = single ? found.at_camera_lenses : found.drift.worst_lenses;
  if (single ? out.stated_lenses <= kMostLenses : !refused)
    out.outcome = out.error_lenses <= kMostLenses ? HandOutcome::Right : HandOutcome::Wrong;
  return out;
}

namespace {

/// Keeps a rectangle of the photograph, given in parts of its sides.
void crop(Photo& photo, double left, double top, double right, double bottom) {
  const auto part = [](double of, int side) { return static_cast<int>(std::lround(of * side)); };
  const int x0 = part(left, photo.width), x1 = part(right, photo.width);
  const int y0 = part(top, photo.height), y1 = part(bottom, photo.height);
  std::vector<uint8_t> codes;
  codes.reserve(static_cast<size_t>(x1 - x0) * static_cast<size_t>(y1 - y0) * 3);
  for (int y = y0; y < y1; ++y) {
    const auto row = photo.codes.begin() + 3 * (static_cast<ptrdiff_t>(y) * photo.width);
    codes.insert(codes.end(), row + 3 * static_cast<ptrdiff_t>(x0),
                 row + 3 * static_cast<ptrdiff_t>(x1));
  }
  photo.codes = std::move(codes);
  photo.width = x1 - x0;
  photo.height = y1 - y0;
}

/// Scales the photograph. Each pixel becomes the mean of those that it covers, or the nearest one.
void resize(Photo& photo, int width, int height) {
  std::vector<uint8_t> codes;
  codes.reserve(static_cast<size_t>(width) * static_cast<size_t>(height) * 3);
  const auto bound = [](int k, int of, int from) {
    return static_cast<int>(static_cast<int64_t>(k) * from / of);
  };
  for (int y = 0; y < height; ++y) {
    const int y0 = bound(y, height, photo.height);
    const int y1 = std::max(bound(y + 1, height, photo.height), y0 + 1);
    for (int x = 0; x < width; ++x) {
      const int x0 = bound(x, width, photo.width);
      const int x1 = std::max(bound(x + 1, width, photo.width), x0 + 1);
      for (int c = 0; c < 3; ++c) {
        int sum = 0;
        for (int j = y0; j < y1; ++j)
          for (int i = x0; i < x1; ++i)
            sum += photo.codes[3 * (static_cast<size_t>(j) * static_cast<size_t>(photo.width) +
                                    static_cast<size_t>(i)) +
                               static_cast<size_t>(c)];
        codes.push_back(static_cast<uint8_t>(sum / ((x1 - x0) * (y1 - y0))));
      }
    }
  }
  photo.codes = std::move(codes);
  photo.width = width;
  photo.height = height;
}

/// Exchanges the pixels of each row, or also the rows.
void mirror(Photo& photo, bool rows_too) {
  const ptrdiff_t row = 3 * static_cast<ptrdiff_t>(photo.width);
  std::ranges::reverse(photo.codes);  // also exchanges red and blue
  for (size_t k = 0; k < photo.codes.size(); k += 3) std::swap(photo.codes[k], photo.codes[k + 2]);
  if (rows_too) return;
  for (int y = 0; y < photo.height / 2; ++y)
    std::swap_ranges(photo.codes.begin() + y * row, photo.codes.begin() + (y + 1) * row,
                     photo.codes.begin() + (photo.height - 1 - y) * row);
}

/// Spreads light along the rows, as a portrait mode does with what it takes for the background.
void spread(Photo& photo, double from, double to, int reach) {
  const int first = static_cast<int>(from * photo.width), last = static_cast<int>(to * photo.width);
  std::vector<uint8_t> sharp;
  for (int y = 0; y < photo.height; ++y) {
    const auto row = photo.codes.begin() + 3 * static_cast<ptrdiff_t>(y) * photo.width;
    sharp.assign(row, row + 3 * static_cast<ptrdiff_t>(photo.width));
    for (int x = first; x < last; ++x)
      for (int c = 0; c < 3; ++c) {
        int sum = 0;
        for (int k = -reach; k <= reach; ++k)
          sum += sharp[3 * static_cast<size_t>(std::clamp(x + k, 0, photo.width - 1)) +
                       static_cast<size_t>(c)];
        row[3 * static_cast<ptrdiff_t>(x) + c] = static_cast<uint8_t>(sum / (2 * reach + 1));
      }
  }
}

/// Darkens every other band of rows: an exposure that is not a multiple of the backlight's period.
void add_bands(Photo& photo, int bands, double darkest) {
  for (int y = 0; y < photo.height; ++y) {
    const double wave = 0.5 + 0.5 * std::cos(2.0 * std::numbers::pi * bands * y / photo.height);
    const auto row = photo.codes.begin() + 3 * static_cast<ptrdiff_t>(y) * photo.width;
    for (ptrdiff_t k = 0; k < 3 * static_cast<ptrdiff_t>(photo.width); ++k)
      row[k] = frames::code_from_linear(std::lerp(darkest, 1.0, wave) *
                                        frames::linear_of_codes()[row[k]]);
  }
}

/// Adds the light of a lamp that the sheet reflects, a disc with a soft border.
void add_lamp(Photo& photo, double x, double y, double radius) {
  for (int j = 0; j < photo.height; ++j)
    for (int i = 0; i < photo.width; ++i) {
      const double off = std::hypot(i - x * photo.width, j - y * photo.height) / photo.width;
      const int more = static_cast<int>(255.0 * std::clamp(2.0 - off / radius, 0.0, 1.0));
      if (more == 0) continue;
      uint8_t* code = photo.codes.data() + 3 * (static_cast<ptrdiff_t>(j) * photo.width + i);
      for (int c = 0; c < 3; ++c) code[c] = static_cast<uint8_t>(std::min(code[c] + more, 255));
    }
}

/// Returns a chart that a program has scaled around its centre: codes between pixels are
/// interpolated.
frames::WovenFrame scaled(const frames::WovenFrame& chart, double scale) {
  frames::WovenFrame out(chart.geometry());
  const double centre_x = 0.5 * (chart.width() - 1), centre_y = 0.5 * (chart.height() - 1);
  for (int y = 0; y < chart.height(); ++y) {
    const double v = centre_y + (y - centre_y) / scale;
    const int above = std::clamp(static_cast<int>(v), 0, chart.height() - 2);
    for (int x = 0; x < chart.width(); ++x) {
      const double u = centre_x + (x - centre_x) / scale;
      const int left = std::clamp(static_cast<int>(u), 0, chart.width() - 2);
      for (int c = 0; c < 3; ++c) {
        const uint8_t* upper = chart.row(above) + 3 * left + c;
        const uint8_t* lower = chart.row(above + 1) + 3 * left + c;
        out.row(y)[3 * x + c] = static_cast<uint8_t>(
            std::lround(std::lerp(std::lerp(upper[0], upper[3], u - left),
                                  std::lerp(lower[0], lower[3], u - left), v - above)));
      }
    }
  }
  return out;
}

void forget_exif(Photo& photo) {
  photo.stated_focal_35mm = 0.0;
  photo.orientation = 1;
}

std::vector<WrongWay> list_of_ways() {
  std::vector<WrongWay> ways;
  const auto taken = [&](const char* name, const char* causes,
                         void (*before)(Taking&, const Workshop&), bool all = false) {
    ways.push_back({.name = name, .causes = causes, .all = all, .before = before});
  };
  const auto edited = [&](const char* name, const char* causes, void (*after)(Photo&),
                          bool all = false) {
    ways.push_back({.name = name, .causes = causes, .all = all, .after = after});
  };
  taken("zoomed by 8 %", "zoomed", [](Taking& t, const Workshop&) { t.phone.focal *= 1.08; });
  taken("wide lens of the phone", "zoomed|cropped|other lens",
        [](Taking& t, const Workshop&) { t.phone.focal *= 0.7; });
  taken("other axis: another phone", "cropped|another lens|zoomed", [](Taking& t, const Workshop&) {
    t.phone.axis = {-t.phone.axis.x - 0.012, 0.01 - t.phone.axis.y};
  });
  edited("cropped", "cropped|another size", [](Photo& p) { crop(p, 0.0, 0.0, 0.93, 0.95); });
  edited("cropped, enlarged to the old size", "cropped|zoomed", [](Photo& p) {
    const int width = p.width, height = p.height;
    crop(p, 0.0, 0.0, 0.94, 0.94);
    resize(p, width, height);
  });
  edited(
      "all cropped alike", "cropped", [](Photo& p) { crop(p, 0.0, 0.0, 0.93, 0.95); }, true);
  edited("resized to two thirds", "another size",
         [](Photo& p) { resize(p, p.width * 2 / 3, p.height * 2 / 3); });
  edited(
      "all resized, without EXIF (messenger)", "too small|certain only|too faint|blurred",
      [](Photo& p) {
        resize(p, 1600, 1600 * p.height / p.width);
        forget_exif(p);
      },
      true);
  edited("all without EXIF", "certain only", forget_exif, true);
  edited("mirrored", "mirrored", [](Photo& p) { mirror(p, false); });
  edited("file turned by 180 degrees", "rotated", [](Photo& p) {
    mirror(p, true);
    p.orientation = 1;
  });
  taken("merged exposures (HDR)", "HDR|processed",
        [](Taking& t, const Workshop&) { t.shot.hdr = true; });
  edited("portrait mode: the left half blurred", "blurred|out of focus|processed|too faint",
         [](Photo& p) { spread(p, 0.0, 0.5, p.width / 250); });
  edited("bands of a dimmed backlight", "dimmed|bands|processed|HDR",
         [](Photo& p) { add_bands(p, 9, 0.3); });
  edited("lamp reflected in the panel", "clipped|darken the room|processed",
         [](Photo& p) { add_lamp(p, 0.35, 0.45, 0.05); });
  taken("out of focus", "out of focus|blurred|too faint",
        [](Taking& t, const Workshop&) { t.phone.blur_px = 20.0; });
  taken("hand that turns by 8 degrees a second", "hand moved", [](Taking& t, const Workshop&) {
    t.shot.turn_degrees_s = {8.0, -6.0, 5.0};
  });
  taken("dark", "too dark|too faint|blurred",
        [](Taking& t, const Workshop&) { t.phone.exposure = 0.01; });
  taken("overexposed", "clipped", [](Taking& t, const Workshop&) { t.phone.exposure = 4.0; });
  taken("room as bright as the panel", "too faint|darken the room",
        [](Taking& t, const Workshop&) { t.shot.room_light = 1.5; });
  taken("too far away", "too far away|too small|too faint",
        [](Taking& t, const Workshop&) { t.shot.eye_mm = t.shot.eye_mm * 3.0; });
  taken("beside the panel", "completely in the picture|in the picture",
        [](Taking& t, const Workshop& w) {
          t.shot.look_at_mm.x += 0.6 * w.start.panel.width_px * w.start.panel.pixel_width.value;
        });
  taken("chart scaled by 5 %", "scaled", [](Taking& t, const Workshop&) { t.chart_scale = 1.05; });
  taken("chart of another rig", "another rig", [](Taking& t, const Workshop&) {
    t.shown.sheet.pitch.value /= 1.13;  // a wider lens might have no room for its tags
    t.shown.sheet.slant += 0.05;
  });
  taken("sheet moved by a fifth of a lens", "the sheet moved",
        [](Taking& t, const Workshop&) { t.build.offset_lenses += 0.2; });
  taken("another panel: pitch 0.3 % off",
        "the sheet moved|another chart|fit no|no sheet|do not fit",
        [](Taking& t, const Workshop&) { t.build.pitch_subpx *= 1.003; });
  // The phases of green may be right, those of red and blue are wrong.
  taken(
      "panel with blue on the left, rig of red", "layout = \"bgr\"",
      [](Taking& t, const Workshop&) { t.panel.layout = optics::SubpixelLayout::bgr(); }, true);
  taken(
      "panel with red above blue", "layout = \"vrgb\"",
      [](Taking& t, const Workshop&) { t.panel.layout = optics::SubpixelLayout::vrgb(); }, true);
  taken(
      "panel with red and blue in turns (PenTile)", "PenTile",
      [](Taking& t, const Workshop&) {
        // Every other pixel has red, the others blue.
        t.panel.layout =
            optics::SubpixelLayout::cells(2, 1,
                                          {{{{0.25, 0.5}, {0.75, 0.5}, {1.25, 0.5}}},
                                           {{{-0.75, 0.5}, {0.75, 0.5}, {0.25, 0.5}}}});
      },
      true);
  taken(
      "all from the same place", "take one more",
      [](Taking& t, const Workshop& w) {
        const uint64_t seed = t.shot.seed;
        t.shot = w.shots.front();
        t.shot.seed = seed;
      },
      true);
  return ways;
}

}  // namespace

std::span<const WrongWay> wrong_ways() {
  static const std::vector<WrongWay> ways = list_of_ways();
  return ways;
}

WrongWayTrial::WrongWayTrial(uint64_t seed, const WorkshopLimits& limits,
                             const std::filesystem::path& parent)
    : workshop_(draw_workshop(seed, limits)),
      sheet_(workshop_.start.panel, workshop_.build),
      folder_(parent) {}
WrongWayTrial::~WrongWayTrial() = default;

std::filesystem::path WrongWayTrial::photograph_of(size_t number, const optics::Rig& shown,
                                                   const WrongWay* way) {
  // The chart is drawn from the owner's start, or from the one better start that a photograph
  // shows.
  const bool again = shown.sheet.pitch.value != workshop_.start.sheet.pitch.value;
  const std::filesystem::path file = folder_.path() / ((way != nullptr ? "wrong-"
                                                        : again        ? "again-"
                                                                       : "right-") +
                                                       std::to_string(number + 1) + ".jpg");
  if (way == nullptr && std::filesystem::exists(file)) return file;
  Taking taking{workshop_.start.panel, workshop_.build, workshop_.phone, workshop_.shots[number],
                shown};
  if (way != nullptr && way->before != nullptr) way->before(taking, workshop_);
  const SheetShape sheet(taking.panel, taking.build);
  frames::WovenFrame chart =
      calib::draw_single_photo_chart(calib::plan_single_photo_chart(taking.shown));
  if (taking.chart_scale != 1.0) chart = scaled(chart, taking.chart_scale);
  Photo photo = photograph(sheet, chart.view(), taking.phone, taking.shot);
  if (way != nullptr && way->after != nullptr) way->after(photo);
  write_photo(photo, taking.phone.jpeg_quality, file);
  return file;
}

namespace {

/// Returns what a refusal blames: of the kinds that it names, the one that it names first.
std::string blamed_by(const std::string& reason) {
  struct Kind {
    const char *text, *words;
  };
  static constexpr Kind kKinds[] = {{"hold the phone still", "hand"},
                                    {"perhaps the hand moved", "perhaps the hand"},
                                    {"axis", "axis or crop"},
                                    {"it was cropped", "axis or crop"},
                                    {"focal length differs", "focal length"},
                                    {"focal length contradict", "focal length"},
                                    {"the sheet moved on the panel by", "sheet"},
                                    {"pixels (rms) off", "tags off"},
                                    {"tags deviate", "tags off"},
                                    {"tags fit no place", "tags off"},
                                    {"what the other photographs predict", "fringes off"},
                                    {"out of focus (contrast", "out of focus"},
                                    {"tags were found", "tags not found"},
                                    {"mirrored: switch", "mirrored"},
                                    {"another rig", "another rig"},
                                    {"another size", "another size"},
                                    {"scaled before", "scaled"},
                                    {"clipped", "clipped"},
                                    {"too dark", "too dark"},
                                    {"too faint", "too faint"},
                                    {"no fringes were found", "no fringes"},
                                    {"fit no even sheet", "no even sheet"},
                                    {"fringes are in the picture", "cut"},
                                    {"of the chart; take", "cut"},
                                    {"too far away", "too far away"},
                                    {"subpixels are not", "layout"},
                                    {"certain only", "not certain enough"}};
  size_t first = std::string::npos;
  std::string out = reason.empty() ? "" : "something else";
  for (const Kind& kind : kKinds)
    if (const size_t at = reason.find(kind.text); at < first) {
      first = at;
      out = kind.words;
    }
  return out;
}

bool has_one_of(const std::string& text, const std::string& causes) {
  for (size_t begin = 0; begin < causes.size();) {
    const size_t end = std::min(causes.find('|', begin), causes.size());
    if (text.find(causes.substr(begin, end - begin)) != std::string::npos) return true;
    begin = end + 1;
  }
  return false;
}

}  // namespace

tools::HandHeldPhotos WrongWayTrial::begin(const WrongWay* way, std::string& reason) {
  optics::Rig start = workshop_.start;
  tools::HandHeldPhotos photos(start);
  reason = photos.add(photograph_of(0, start, way));
  // The owner obeys the program, which asks once for a new start if the pitch is far off.
  if (const auto better = photos.better_start()) {
    start = *better;
    photos = tools::HandHeldPhotos(start);
    reason = photos.add(photograph_of(0, start, way));
  }
  for (size_t k = 1; k + 1 < workshop_.shots.size(); ++k)
    if (std::string refusal = photos.add(photograph_of(k, start, way)); !refusal.empty())
      reason = std::move(refusal);
  return photos;
}

WrongWayResult WrongWayTrial::calibrate(const WrongWay& way) {
  WrongWayResult out;
  if (!way.all && !right_)
    right_ = std::make_unique<tools::HandHeldPhotos>(begin(nullptr, right_reason_));
  out.reason = right_reason_;
  tools::HandHeldPhotos photos = way.all ? begin(&way, out.reason) : *right_;
  const optics::Rig start = photos.chart().start;
  if (std::string refusal = photos.add(photograph_of(workshop_.shots.size() - 1, start, &way));
      !refusal.empty())
    out.reason = std::move(refusal);
  const calib::Calibration found = photos.calibrate();
  if (found.verdict != calib::Verdict::Refused)
    out.error_lenses = worst_error(found.rig, sheet_, judged_eyes(workshop_.start));
  // A photograph that cannot be used is named at once; the owner takes it again.
  if (out.reason.empty() && found.verdict != calib::Verdict::Refused)
    out.outcome =
        out.error_lenses <= HandTrial::kMostLenses ? HandOutcome::Right : HandOutcome::Wrong;
  else if (found.verdict != calib::Verdict::Refused && out.error_lenses > HandTrial::kMostLenses)
    out.outcome = HandOutcome::Wrong;
  // Beside the reasons, the command says which photograph it set aside, and why.
  if (out.reason.empty() && !found.reasons.empty())
    out.reason = found.set_aside.empty() ? found.reasons.front() : found.set_aside[0].reason;
  Taking taken{workshop_.start.panel, workshop_.build, workshop_.phone, workshop_.shots[0], start};
  if (way.before != nullptr) way.before(taken, workshop_);
  if (out.outcome == HandOutcome::Right && taken.panel.layout != start.panel.layout)
    out.outcome = HandOutcome::Wrong;
  out.cause_named = has_one_of(out.reason, way.causes);
  out.blamed = blamed_by(out.reason);
  return out;
}
}  // namespace lenticule::lab
