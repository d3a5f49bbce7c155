// SPDX-License-Identifier: Apache-2.0
// Tests overlays: each subpixel in scan-out memory against an oracle, and when they are shown.
#include "player/playback/overlay.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <random>
#include <thread>

#include "display/virtual/virtual_display.h"
#include "frames/picture_codec.h"
#include "frames/qr/qr_code.h"
#include "optics/eye_simulator.h"
#include "optics/rig_file.h"
#include "player/playback/playback.h"
#include "player/playlist/playlist_source.h"
#include "tests/support/allocation_count.h"
#include "tests/support/fakes/faulty_display.h"
#include "tests/support/fakes/scanout_words.h"
#include "tests/support/oracles/overlay_oracle.h"
#include "tests/unit/player/playlist/fake_items.h"

namespace lenticule::player {
namespace {

using frames::FrameGeometry;
using frames::WovenFrame;
using test::numbered_frame;
using test::RgbaPicture;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr FrameGeometry kPanel{.width = 150, .height = 100};
constexpr int kMargin = 2;  // pixels of this panel

/// A fake disk with pictures.
class PicturesInMemory final : public frames::PictureFileReader {
 public:
  std::map<std::string, RgbaPicture> pictures;

  frames::PictureInfo probe(const std::filesystem::path& file) const override {
    const RgbaPicture& picture = named(file.filename().string());
    return {.geometry = {.width = picture.width, .height = picture.height}, .pixel_bytes = 4};
  }
  void read(const frames::EncodedPicture& encoded, frames::PictureSink& sink,
            frames::PictureValues) const override {
    const RgbaPicture& picture = named(encoded.file.filename().string());
    sink.accept(probe(encoded.file));
    std::ranges::copy(picture.rgba, sink.rows(0, picture.height).begin());
  }

 private:
  [[nodiscard]] const RgbaPicture& named(const std::string& name) const {
    const auto found = pictures.find(name);
    if (found == pictures.end())
      throw Error(ErrorKind::Input, name + ": cannot read: no such file", "look for it");
    return found->second;
  }
};

RgbaPicture random_picture(int width, int height) {
  std::mt19937 random(7);
  RgbaPicture picture{width, height};
  picture.rgba.resize(4 * static_cast<size_t>(width * height));
  for (size_t n = 0; n < picture.rgba.size(); ++n) {
    picture.rgba[n] = static_cast<uint8_t>(random());
    if (n % 4 == 3 && random() % 2 == 0) picture.rgba[n] = random() % 2 == 0 ? 0 : 255;
  }
  return picture;
}

OverlaySpec parsed(const char* json) { return parse_overlay(nlohmann::json::parse(json)); }

/// Remembers the words of each displayed frame.
class WordRecorder final : public display::ScanoutRecorder {
 public:
  std::vector<std::vector<uint32_t>> frames;
  void record(const display::ShownFrame&, const display::ScanoutView& view) noexcept override {
    std::vector<uint32_t>& words = frames.emplace_back();
    for (int row = 0; row < view.geometry.height; ++row)
      words.insert(words.end(), view.pixels + static_cast<size_t>(row) * view.stride,
                   view.pixels + static_cast<size_t>(row) * view.stride +
                       static_cast<size_t>(view.geometry.width));
  }
  void finish() override {}
};

class Overlays : public testing::Test {
 protected:
  PicturesInMemory disk;
  test::FakeShelf shelf;
  std::vector<PlaylistEvent> events;
  std::time_t now = 1'700'000'000;  // 22:13:20 UTC
  std::unique_ptr<PlaylistSource> source;

  void SetUp() override {
    ::setenv("TZ", "UTC0", 1);
    ::tzset();
    frames::use_picture_reader(&disk);
    disk.pictures["logo.png"] = random_picture(21, 13);
  }
  void TearDown() override { frames::use_picture_reader(nullptr); }

  void put(const std::string& name, uint64_t frames, uint64_t base = 0) {
    shelf.put(name, {base, {.geometry = kPanel, .frames = frames, .rate = frames::Rate{10, 1}}});
  }
  PlaylistSource& open(Playlist list) {
    source = std::make_unique<PlaylistSource>(
        std::make_shared<const Playlist>(std::move(list)),
        PlaylistSourceOptions{.panel = kPanel,
                              .open = shelf.opener(),
                              .clock = [this] { return now; },
                              .on_event = [this](const auto& event) { events.push_back(event); }});
    source->open_first();
    return *source;
  }
  static Playlist list_of(const std::string& name, std::vector<OverlaySpec> overlays) {
    Playlist list = test::list_of({name});
    list.items.front().overlays = std::move(overlays);
    return list;
  }
  [[nodiscard]] std::optional<frames::AcquiredFrame> next() const {
    frames::AcquiredFrame frame;
    while (true) {
      const frames::PullStatus status = source->pull(frame);
      if (status == frames::PullStatus::Ready) return frame;
      if (status != frames::PullStatus::NotYet) return std::nullopt;
      source->service();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  /// Returns the next frame with its overlays.
  [[nodiscard]] std::optional<WovenFrame> next_drawn() const {
    const auto frame = next();
    if (!frame) return std::nullopt;
    WovenFrame drawn(kPanel);
    std::ranges::copy(frame->frame.bytes, drawn.bytes().begin());
    for (const OverlayBox& box : source->boxes_over(*frame))
      box.copy_into(drawn.bytes(), drawn.geometry());
    source->release(frame->token);
    return drawn;
  }
  /// Returns the numbers of the next frames that have overlays, of at most so many.
  [[nodiscard]] std::vector<int> overlaid(int most) const {
    std::vector<int> numbers;
    for (int n = 0; n < most; ++n) {
      const auto frame = next();
      if (!frame) break;
      if (!source->boxes_over(*frame).empty()) numbers.push_back(n);
      source->release(frame->token);
    }
    return numbers;
  }
};

/// Each mounting, with 8 and 10 bits.
class OverlaysOnPanels
    : public Overlays,
      public testing::WithParamInterface<std::tuple<const char*, display::ScanoutDepth>> {};

TEST_P(OverlaysOnPanels, BlendEachSubpixelAsTheOracleAndLeaveTheOthersAsTheyAre) {
  const optics::Mounting mounting = optics::mounting_named(std::get<0>(GetParam()));
  const display::ScanoutDepth depth = std::get<1>(GetParam());
  put("film", 3);
  const auto recorder = std::make_shared<WordRecorder>();
  const auto display =
      display::open_virtual_display({.geometry = display::turned(kPanel, mounting),
                                     .mounting = mounting,
                                     .depth = depth,
                                     .clock = std::make_shared<display::SimulatedClock>(),
                                     .recorder = recorder});
  PlaylistSource& list =
      open(list_of("film", {parsed(R"({"picture": "logo.png", "at": "top right"})"),
                            parsed(R"({"picture": "logo.png", "at": "middle", "for_s": 0.15})")}));
  const PlayResult result = play(
      *display, list, {.filling = Filling::InPresenter, .overlays = [&list](const auto& frame) {
                         return list.boxes_over(frame);
                       }});
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(result.report.overlaid, 3U);
  ASSERT_EQ(recorder->frames.size(), 3U);
  const FrameGeometry sent = display::turned(kPanel, mounting);
  for (uint64_t k = 0; k < 3; ++k) {
    WovenFrame expected = numbered_frame(kPanel, k);
    const RgbaPicture& logo = disk.pictures["logo.png"];
    test::draw_over(expected, logo, kPanel.width - kMargin - 21, kMargin);
    if (k < 2) test::draw_over(expected, logo, (kPanel.width - 21) / 2, kMargin + (83 / 2));
    for (int row = 0; row < sent.height; ++row)
      for (int column = 0; column < sent.width; ++column) {
        const optics::PixelPlace seen =
            mounting.seen_place({column, row}, {kPanel.width, kPanel.height});
        ASSERT_EQ(recorder->frames[k][static_cast<size_t>(row * sent.width + column)],
                  test::scanout_word(expected.row(seen.row) + 3 * seen.column, depth))
            << "frame " << k << ", seen " << seen.column << ", " << seen.row;
      }
  }
}
INSTANTIATE_TEST_SUITE_P(
    Mountings, OverlaysOnPanels,
    testing::Combine(testing::Values("0", "90", "180", "270", "mirrored", "mirrored 90",
                                     "mirrored 180", "mirrored 270"),
                     testing::Values(display::ScanoutDepth::Bits8, display::ScanoutDepth::Bits10)));

TEST_F(Overlays, ALaterOneCoversAnEarlierOneAndShowsItWhereItIsTransparent) {
  put("film", 1);
  disk.pictures["other.png"] = random_picture(30, 20);
  (void)open(list_of("film", {parsed(R"({"picture": "other.png", "at": "top left"})"),
                              parsed(R"({"picture": "logo.png", "at": "top left"})")}));
  WovenFrame expected = numbered_frame(kPanel, 0);
  test::draw_over(expected, disk.pictures["other.png"], kMargin, kMargin);
  test::draw_over(expected, disk.pictures["logo.png"], kMargin, kMargin);
  EXPECT_EQ(next_drawn(), expected);
}

TEST_F(Overlays, AReducedPictureKeepsColoursAndTheMeanOfItsAlpha) {
  // The colour of transparent pixels does not count.
  disk.pictures["two.png"] = {2,
                              2,
                              {200, 100, 50, 255, 9, 9, 9, 0,  //
                               200, 100, 50, 255, 9, 9, 9, 0}};
  put("film", 1);
  (void)open(
      list_of("film", {parsed(R"({"picture": "two.png", "at": "top left", "height": 0.01})")}));
  const WovenFrame drawn = *next_drawn(), film = numbered_frame(kPanel, 0);
  for (int c = 0; c < 3; ++c) {
    const uint8_t below = film.row(kMargin)[3 * kMargin + c];
    EXPECT_EQ(drawn.row(kMargin)[3 * kMargin + c],
              test::blended_code(
                  below, std::array<uint8_t, 3>{200, 100, 50}.at(static_cast<size_t>(c)), 128));
  }
}

TEST_F(Overlays, EachPanelOfAWallHasItsOwn) {
  const std::array<FrameGeometry, 2> panels = {kPanel, FrameGeometry{.width = 60, .height = 50}};
  const std::array<OverlaySpec, 1> specs = {parsed(R"({"picture": "logo.png"})")};
  OverlaySet set(specs, panels);
  const WovenFrame a(panels[0]), b(panels[1]);
  const std::array<frames::FrameView, 2> parts = {a.view(), b.view()};
  std::vector<OverlayBox> boxes;
  set.draw({.geometry = {.width = 210, .height = 100}, .bytes = {}, .parts = parts}, ~0U, 0, boxes);
  ASSERT_EQ(boxes.size(), 2U);
  EXPECT_EQ(boxes[0].part, 0U);
  EXPECT_EQ(boxes[0].left, 150 - 2 - 21);
  EXPECT_EQ(boxes[1].part, 1U);
  EXPECT_EQ(boxes[1].left, 60 - 1 - 21);
  EXPECT_EQ(boxes[1].top, 50 - 1 - 13);
}

// --- times ----------------------------------------------------------------------------------

TEST_F(Overlays, TheTimesOfAnOverlayCountFromTheFirstFrameOfTheItemOverItsLoops) {
  put("film", 4);
  Playlist list = list_of("film", {parsed(R"({"text": "x", "from_s": 0.6, "for_s": 0.3})")});
  list.items.front().loops = 4;
  list.rounds = 2;
  (void)open(list);
  EXPECT_THAT(overlaid(100), ElementsAre(6, 7, 8, 22, 23, 24));
}

TEST_F(Overlays, TheTimesCountWhatIsShownOfAFilmWithAnIntroduction) {
  shelf.put("loop", {.script = {.geometry = kPanel, .frames = 6, .rate = frames::Rate{10, 1}},
                     .loop_begin = 4});
  Playlist list = list_of("loop", {parsed(R"({"text": "x", "from_s": 0.9, "for_s": 0.2})")});
  list.items.front().loops = 4;
  (void)open(list);
  EXPECT_THAT(overlaid(100), ElementsAre(9, 10));
}

TEST_F(Overlays, AJumpToAFrameIsAJumpInTime) {
  put("film", 50);
  (void)open(list_of("film", {parsed(R"({"text": "x", "from_s": 2, "for_s": 0.5})")}));
  EXPECT_THAT(overlaid(3), IsEmpty());
  std::atomic<bool> done{false};
  source->jump({.item = 0, .frame = 18}, [&done](const Error* error) {
    EXPECT_EQ(error, nullptr);
    done = true;
  });
  while (!done) {
    source->service();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_THAT(overlaid(20), ElementsAre(2, 3, 4, 5, 6));
}

TEST_F(Overlays, AStillPictureHasThemInItsSecondsAndInItsTransition) {
  put("film", 3);
  shelf.put("still", {10, {.geometry = kPanel, .frames = 1}});
  Playlist list = test::list_of({"film", "still"});
  list.items[1].still_s = 3.0;
  list.items[1].transition = TransitionKind::Cross;
  list.items[1].transition_s = 0.5;
  list.items[1].overlays = {parsed(R"({"text": "x", "from_s": 0.25, "for_s": 1.5})")};
  (void)open(list);
  // 30 steps of the transition at 60 Hz, then four frames a second.
  std::vector<int> expected;
  for (int n = 3 + 15; n < 3 + 30 + 5; ++n) expected.push_back(n);
  EXPECT_EQ(overlaid(100), expected);
}

TEST_F(Overlays, AClockShowsTheLocalTimeAndChangesWithTheMinute) {
  put("film", 100);
  (void)open(list_of("film", {parsed(R"({"clock": "%H:%M", "height": 0.2})")}));
  uint64_t shown = 0;
  const auto text = [&shown](const char* words) {
    const std::array<OverlaySpec, 1> specs = {
        parsed((R"({"text": ")" + std::string(words) + R"(", "height": 0.2})").c_str())};
    const std::array<FrameGeometry, 1> panels = {kPanel};
    OverlaySet set(specs, panels);
    WovenFrame frame = numbered_frame(kPanel, shown);
    std::vector<OverlayBox> boxes;
    set.draw(numbered_frame(kPanel, shown++).view(), 1, 0, boxes);
    boxes.front().copy_into(frame.bytes(), kPanel);
    return frame;
  };
  EXPECT_EQ(next_drawn(), text("22:13"));
  now += 39;
  EXPECT_EQ(next_drawn(), text("22:13"));
  now += 1;
  EXPECT_EQ(next_drawn(), text("22:14"));
}

TEST_F(Overlays, AFrameThatIsCopiedAgainShowsTheTimeAtWhichItWasTaken) {
  put("film", 100);
  (void)open(list_of("film", {parsed(R"({"clock": "%H:%M:%S", "height": 0.2})")}));
  const auto drawn = [this](const frames::AcquiredFrame& frame) {
    WovenFrame picture(kPanel);
    for (const OverlayBox& box : source->boxes_over(frame)) box.copy_into(picture.bytes(), kPanel);
    return picture;
  };
  const frames::AcquiredFrame first = *next();
  const WovenFrame before = drawn(first);
  ++now;
  const frames::AcquiredFrame second = *next();
  EXPECT_NE(drawn(second), before);
  EXPECT_EQ(drawn(first), before);
  source->release(first.token);
  source->release(second.token);
}

// --- live -----------------------------------------------------------------------------------

TEST_F(Overlays, ALiveOneIsOverEachItemUntilItsTimeIsOverOrItIsReplaced) {
  put("a", 100);
  put("b", 100, 200);
  Playlist list = test::list_of({"a", "b"}, kForever);
  list.items.front().overlays = {parsed(R"({"picture": "logo.png"})")};
  (void)open(list);
  const std::array<FrameGeometry, 1> panels = {kPanel};
  const auto live = [&panels](const char* json) {
    const std::array<OverlaySpec, 1> specs = {parsed(json)};
    return std::make_shared<OverlaySet>(specs, panels);
  };
  (void)overlaid(1);
  EXPECT_THAT(source->status().overlays, ElementsAre("picture logo.png, bottom right"));
  source->show_over(live(R"({"text": "Closed", "at": "top"})"), std::nullopt);
  (void)overlaid(1);
  EXPECT_THAT(source->status().overlays,
              ElementsAre("picture logo.png, bottom right", "text Closed, top"));
  EXPECT_EQ(overlaid(100).size(), 100U) << "over the other item, too";
  EXPECT_THAT(source->status().overlays, ElementsAre("text Closed, top"));
  source->show_over(live(R"({"text": "Open", "at": "top"})"), 0.05);
  (void)overlaid(1);
  EXPECT_THAT(source->status().overlays, ElementsAre("text Open, top"));
  std::this_thread::sleep_for(std::chrono::milliseconds(60));
  EXPECT_THAT(overlaid(1), IsEmpty());
  EXPECT_THAT(source->status().overlays, IsEmpty());
  source->show_over(live(R"({"code": "secret", "height": 0.5})"), std::nullopt);
  EXPECT_EQ(overlaid(1).size(), 1U);
  EXPECT_THAT(source->status().overlays, ElementsAre("code, bottom right"));
  source->show_over(nullptr, std::nullopt);
  EXPECT_THAT(overlaid(1), IsEmpty());
  EXPECT_THAT(source->account_of(2)->overlays,
              ElementsAre("text Closed, top", "text Open, top", "code, bottom right"));
}

// --- what is drawn ----------------------------------------------------------------------------

TEST_F(Overlays, ACodeOverAFilmIsReadableThroughTheLensesFromEveryPlace) {
  constexpr const char* kAddress = "https://example.org/more";
  for (const char* name : {"scenes/rigs/kiosk-27-1080.toml", "scenes/rigs/kiosk-27-4k.toml"}) {
    const optics::Rig rig = optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/" + name);
    const FrameGeometry panel{.width = rig.panel.width_px, .height = rig.panel.height_px};
    const std::array<OverlaySpec, 1> specs = {parsed(R"({"code": "https://example.org/more"})")};
    OverlaySet set(specs, {&panel, 1});
    WovenFrame frame = numbered_frame(panel, 1);
    std::vector<OverlayBox> boxes;
    set.draw(numbered_frame(panel, 1).view(), 1, 0, boxes);
    const OverlayBox& box = boxes.front();
    box.copy_into(frame.bytes(), panel);
    const frames::QrCode code = frames::qr_code_of(kAddress);
    const int module_px = box.pixels.geometry.width / (code.side + 2 * frames::kQrBorder);
    for (const double x : {-250.0, -31.0, 0.0, 31.0, 200.0}) {
      const optics::RgbPicture seen =
          optics::simulate_eye(optics::OpticalModel(rig),
                               {.pixels = frame.bytes().data(),
                                .width = panel.width,
                                .height = panel.height,
                                .stride_bytes = panel.row_bytes()},
                               {.x = x, .y = 40.0, .z_mm = 600.0},
                               {.width = panel.width / 2, .height = panel.height / 2});
      const auto wrong_modules = [&](int right, int down) {
        int wrong = 0;
        for (int v = 0; v < code.side; ++v)
          for (int u = 0; u < code.side; ++u) {
            // The mean of a quarter of the module, as a camera sees it.
            const int reach = std::max(1, module_px / 8);
            const auto middle = [module_px](int begin, int k) {
              return (begin + (k + frames::kQrBorder) * module_px + module_px / 2) / 2;
            };
            const int x0 = middle(box.left, u) + right, y0 = middle(box.top, v) + down;
            int sum = 0, count = 0;
            for (int j = y0 - reach; j <= y0 + reach; ++j)
              for (int i = x0 - reach; i <= x0 + reach; ++i)
                for (int c = 0; c < 3; ++c, ++count)
                  sum += seen.pixels[static_cast<size_t>((j * seen.width + i) * 3 + c)];
            wrong += (sum < 128 * count) != code.is_dark(u, v) ? 1 : 0;
          }
        return wrong;
      };
      // A scanner finds the code wherever it is: behind a sheet, an oblique view moves it a little.
      int wrong = code.side * code.side;
      for (int down = -4; down <= 4; ++down)
        for (int right = -6; right <= 6; ++right)
          wrong = std::min(wrong, wrong_modules(right, down));
      EXPECT_EQ(wrong, 0) << name << " from " << x << " mm";
    }
  }
}

TEST_F(Overlays, ATextIsBrokenIntoLinesThatFitThePanel) {
  put("film", 2);
  const std::array<FrameGeometry, 1> panels = {kPanel};
  const std::array<OverlaySpec, 2> specs = {
      parsed(R"({"text": "Open until eight in the evening\nevery day", "at": "bottom"})"),
      parsed(R"({"text": "Open", "at": "bottom"})")};
  OverlaySet set(specs, panels);
  std::vector<OverlayBox> boxes;
  set.draw(numbered_frame(kPanel, 0).view(), ~0U, 0, boxes);
  ASSERT_EQ(boxes.size(), 2U);
  EXPECT_EQ(boxes[0].pixels.geometry.height, 3 * 10 - 1 + 6);
  EXPECT_LE(boxes[0].pixels.geometry.width, kPanel.width);
  EXPECT_EQ(boxes[1].pixels.geometry, (FrameGeometry{.width = 4 * 6 - 1 + 6, .height = 15}));
}

TEST_F(Overlays, DrawingAllocatesNothingAlsoWhenAClockChanges) {
  const std::array<FrameGeometry, 1> panels = {kPanel};
  const std::array<OverlaySpec, 4> specs = {
      parsed(R"({"clock": "%A %H:%M:%S"})"), parsed(R"({"picture": "logo.png"})"),
      parsed(R"({"text": "Open", "at": "top"})"), parsed(R"({"code": "x", "height": 0.5})")};
  OverlaySet set(specs, panels);
  const WovenFrame film = numbered_frame(kPanel, 0);
  std::vector<OverlayBox> boxes;
  boxes.reserve(specs.size());
  const long before = allocations;
  for (int k = 0; k < 1000; ++k) {
    boxes.clear();
    set.draw(film.view(), ~0U, now + std::time_t{997} * k, boxes);
  }
  EXPECT_EQ(boxes.size(), specs.size());
  EXPECT_EQ(allocations, before);
}

TEST_F(Overlays, OneThatCannotBeDrawnIsLeftOutAndTheFilmPlaysWithTheOthers) {
  disk.pictures["large.png"] = random_picture(200, 20);
  put("film", 5);
  (void)open(list_of(
      "film",
      {parsed(R"({"picture": "gone.png"})"), parsed(R"({"picture": "large.png"})"),
       parsed(R"({"code": "https://example.org/", "height": 0.1})"),
       parsed(R"({"text": "x", "height": 1})"), parsed(R"({"picture": "logo.png"})"),
       parsed(fmt::format(R"({{"text": "{}", "height": 0.3}})", std::string(500, 'x')).c_str())}));
  EXPECT_EQ(overlaid(100).size(), 5U);
  EXPECT_THAT(source->status().overlays, ElementsAre("picture logo.png, bottom right"));
  std::vector<std::string> problems;
  for (const PlaylistEvent& event : events)
    if (event.kind == PlaylistEvent::Kind::BadOverlay) problems.push_back(event.detail);
  EXPECT_THAT(problems,
              ElementsAre("gone.png: cannot read: no such file; look for it",
                          "large.png: 200x20 pixels, but the panel has 150x100; state a smaller "
                          "height, for example height = 0.1",
                          HasSubstr("code: "), HasSubstr("text x, bottom right: "),
                          HasSubstr("does not fit the panel")));
}

TEST(OverlaySpec, NamesTheKeyAndTheCauseOfWrongOnes) {
  const auto complaint = [](const char* json) {
    try {
      (void)parsed(json);
    } catch (const Error& error) {
      return std::string(error.what()) + (error.hint().empty() ? "" : "; " + error.hint());
    }
    return std::string("none");
  };
  EXPECT_EQ(complaint(R"({"text": "Grüße"})"),
            "text: the font has no letter 'ü'; use printable ASCII, or a picture of the text");
  EXPECT_EQ(complaint(R"({"clock": "%H Uhr é"})"),
            "clock: the font has no letter 'é'; use printable ASCII, or a picture of the text");
  for (const char* format : {"%", "%Q", "%H:%", "%-", "%n", "%t", "%Ec"})
    EXPECT_THAT(complaint((R"({"clock": ")" + std::string(format) + "\"}").c_str()),
                HasSubstr("not a format of strftime"))
        << format;
  EXPECT_THAT(complaint(R"({"clock": "%c %c %c %c %c"})"), HasSubstr("more than 40 letters"));
  EXPECT_THAT(complaint(R"({})"), HasSubstr("nothing to show"));
  EXPECT_THAT(complaint(R"({"at": "top"})"), HasSubstr("nothing to show"));
  EXPECT_EQ(complaint(R"({"text": "a", "clock": "%H"})"), "text: not together with clock");
  EXPECT_THAT(complaint(R"({"text": ""})"), HasSubstr("text: not a text of 1 to 500 bytes"));
  EXPECT_THAT(complaint(R"({"text": 5})"), HasSubstr("text: not a text"));
  EXPECT_THAT(complaint(R"({"text": "a", "at": "above"})"), HasSubstr("at: no such place"));
  EXPECT_THAT(complaint(R"({"text": "a", "height": 0})"),
              HasSubstr("height: not a number above 0"));
  EXPECT_THAT(complaint(R"({"text": "a", "height": 1.1})"), HasSubstr("height: "));
  EXPECT_THAT(complaint(R"({"text": "a", "from_s": -1})"),
              HasSubstr("from_s: not a number from 0"));
  EXPECT_THAT(complaint(R"({"text": "a", "for_s": -1})"), HasSubstr("for_s: not a number above 0"));
  EXPECT_THAT(complaint(R"({"text": "a", "colour": "red"})"), HasSubstr("colour: unknown key"));
  EXPECT_EQ(parsed(R"({"clock": "%A %-d %B, %H:%M"})").kind, OverlaySpec::Kind::Clock);
}

}  // namespace
}  // namespace lenticule::player
