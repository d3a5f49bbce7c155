// SPDX-License-Identifier: Apache-2.0
// Tests that the metadata survive the conversion to JSON and back, and that errors name their key.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frames/sequence/sequence_format.h"
#include "small_sequences.h"
#include "tests/support/error_matchers.h"

namespace lenticule::frames {
namespace {

using test::error_of;
using ::testing::HasSubstr;

constexpr FrameGeometry kGeometry{800, 600};

SequenceInfo round_trip(const SequenceInfo& info) {
  return parse_sequence_info(sequence_info_to_json(info), info.geometry, "a.lts");
}

TEST(SequenceInfo, RoundTrips) {
  SequenceInfo info = test::info_of(kGeometry);
  EXPECT_EQ(round_trip(info), info);
  state_rig(info, {.fingerprint = "0123456789abcdef",
                   .calibration = "fedcba9876543210",
                   .trim = {.offset = Lenses(-0.01), .pitch_relative = 1e-5}});
  info.made_from = "scenes/demo.nff";
  EXPECT_EQ(round_trip(info), info);
  EXPECT_EQ(rig_of(round_trip(info)).calibration, "fedcba9876543210");
  info.first_frame = 17;
  info.loop_begin = 3;
  info.loop_end = 9;
  EXPECT_EQ(round_trip(info), info);
  info.kind = SequenceKind::Views;
  info.views = SequenceViews{.count = 45,
                             .columns = 5,
                             .rows = 9,
                             .rightmost_first = true,
                             .aspect = 0.75,
                             .cone_degrees = 40.0,
                             .focus = 1.5};
  EXPECT_EQ(round_trip(info), info);
}

TEST(SequenceInfo, OpensAFilmThatNamesAZone) {
  const SequenceInfo info = test::info_of(kGeometry);
  std::string json = sequence_info_to_json(info);
  json.insert(json.rfind('}'), R"(, "zone": "-60:60@650:750")");
  EXPECT_EQ(parse_sequence_info(json, kGeometry, "a.lts"), info);
}

TEST(SequenceInfo, AcceptsTextThatIsNotUnicode) {
  SequenceInfo info = test::info_of(kGeometry);
  info.software = "\xff\xfe";
  EXPECT_FALSE(round_trip(info).software.empty());
}

TEST(SequenceInfo, NamesTheInvalidKey) {
  const auto cause = [](const std::string& json) {
    const Error error = error_of([&] { (void)parse_sequence_info(json, kGeometry, "a.lts"); });
    EXPECT_EQ(error.kind(), ErrorKind::Input);
    return std::string(error.what());
  };
  EXPECT_THAT(cause("nonsense"), HasSubstr("a.lts: metadata: not JSON"));
  EXPECT_THAT(cause("[]"), HasSubstr("not a JSON object"));
  EXPECT_THAT(cause(R"({"kind": "solid"})"), HasSubstr("kind"));
  EXPECT_THAT(cause(R"({"kind": "woven"})"), HasSubstr("rate: missing"));
  EXPECT_THAT(cause(R"({"kind": "woven", "rate": [0, 1]})"), HasSubstr("rate"));
  EXPECT_THAT(cause(R"({"kind": "woven", "rate": [24]})"), HasSubstr("rate"));
  EXPECT_THAT(cause(R"({"kind": "woven", "rate": [24, 1], "loop": [5, 5]})"), HasSubstr("loop"));
  EXPECT_THAT(cause(R"({"kind": "woven", "rate": [24, 1], "rig_toml": 5})"), HasSubstr("rig_toml"));
  EXPECT_THAT(cause(R"({"kind": "woven", "rate": [24, 1], "rig_trim":
                        {"calibration": "beef", "offset_lenses": 2}})"),
              HasSubstr("offset_lenses: not in -1 to 1"));
  EXPECT_THAT(cause(R"({"kind": "views", "rate": [24, 1]})"), HasSubstr("views: missing"));
  EXPECT_THAT(cause(R"({"kind": "views", "rate": [24, 1], "views":
                        {"count": 9, "columns": 2, "rows": 2, "order": "left-to-right"}})"),
              HasSubstr("does not fit"));
}

TEST(SequenceInfo, DeepNestingIsRefusedOrIgnored) {
  const std::string deep = R"({"kind": "woven", "rate": [24, 1], "x": )" +
                           std::string(100000, '[') + std::string(100000, ']') + "}";
  try {
    EXPECT_EQ(parse_sequence_info(deep, kGeometry, "a.lts").rate, make_rate(24, 1));
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Input);
  }
}

}  // namespace
}  // namespace lenticule::frames
