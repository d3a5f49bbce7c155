// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "frames/views_input/content_name.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::error_of;

QuiltSidecar parsed(const std::string& json) {
  return parse_quilt_sidecar(json, "city.json").value();
}

TEST(QuiltSidecar, ReadsCommonSpellings) {
  const char* const files[] = {
      R"({"columns": 8, "rows": 6, "viewCount": 45, "aspect": 0.75, "invert": 1})",
      R"({"cols": 8, "rows": 6, "view_count": 45, "aspect": 0.75, "invert_views": true})",
      R"({"tileX": 8, "tileY": 6, "numViews": 45, "quiltAspect": 0.75, "invView": {"value": 1}})",
      R"({"movie": false, "quilt_settings": {"viewX": 8, "viewY": 6, "viewTotal": 45,
          "invertViews": true, "aspect": 0.75}, "depthiness": 1.0})"};
  for (const char* const json : files) {
    const QuiltSidecar sidecar = parsed(json);
    EXPECT_EQ(sidecar.columns, 8) << json;
    EXPECT_EQ(sidecar.rows, 6) << json;
    EXPECT_EQ(sidecar.views, 45) << json;
    EXPECT_EQ(sidecar.aspect, 0.75) << json;
    EXPECT_TRUE(sidecar.inverted) << json;
    EXPECT_FALSE(sidecar.depth) << json;
  }
  EXPECT_FALSE(parsed(R"({"columns": 5, "rows": 9, "aspect": -1})").aspect);
}

TEST(QuiltSidecar, ReadsThePositionOfTheDepthMap) {
  const QuiltSidecar bottom = parsed(
      R"({"isRGBD": 1, "rows": 8, "columns": 6, "aspect": 1.5, "depth_loc": 0,
          "depth_inversion": 1, "depthiness": 0.5})");
  EXPECT_EQ(bottom.depth, DepthPlace::Bottom);
  EXPECT_TRUE(bottom.black_is_near);
  EXPECT_EQ(bottom.depthiness, 0.5);
  EXPECT_EQ(bottom.aspect, 1.5);
  EXPECT_FALSE(bottom.columns) << "the quilt that others would make of it";
  EXPECT_EQ(parsed(R"({"isRGBD": true, "depthPosition": "left"})").depth, DepthPlace::Left);
  EXPECT_EQ(parsed(R"({"isRGBD": 1})").depth, DepthPlace::Right);
}

TEST(QuiltSidecar, IsIgnoredIfItIsNotAboutQuilts) {
  for (const char* const json :
       {"{}", "[1, 2]", R"({"shown": 30, "views": 3})", "null", R"({"isRGBD": 0})"})
    EXPECT_FALSE(parse_quilt_sidecar(json, "city.json")) << json;
}

TEST(QuiltSidecar, ErrorsNameFileAndReason) {
  const std::pair<const char*, const char*> wrong[] = {
      {"{", "city.json"},
      {R"({"columns": 8})", "rows"},
      {R"({"columns": 0, "rows": 6})", "columns"},
      {R"({"columns": 2.5, "rows": 6})", "columns"},
      {R"({"columns": "8", "rows": 6})", "columns"},
      {R"({"columns": 4000, "rows": 4000})", "4000 x 4000"},
      {R"({"columns": 2, "rows": 2, "viewCount": 5})", "5 views"},
      {R"({"columns": 2, "rows": 2, "aspect": 1e9})", "aspect"},
      {R"({"isRGBD": 1, "depth_loc": 4})", "depth_loc"},
      {R"({"isRGBD": 1, "depthPosition": "inside"})", "depthPosition"},
      {R"({"isRGBD": 1, "chroma_depth": 1})", "chroma_depth"},
      {R"({"isRGBD": 1, "depthiness": -1})", "depthiness"}};
  for (const auto& [json, named] : wrong) {
    const Error error =
        error_of([&, text = json] { (void)parse_quilt_sidecar(text, "city.json"); });
    EXPECT_EQ(error.kind(), ErrorKind::Input) << json;
    EXPECT_THAT(error.what(), testing::StartsWith("city.json")) << json;
    EXPECT_THAT(error.what(), testing::HasSubstr(named)) << json;
  }
}

TEST(QuiltSidecar, LiesBesideThePicture) {
  const test::ScratchFolder folder;
  const auto picture = folder.path() / "city.png";
  EXPECT_FALSE(read_sidecar_of(picture));
  std::ofstream(folder.path() / "city.json") << R"({"columns": 3, "rows": 2})";
  EXPECT_EQ(read_sidecar_of(picture).value().columns, 3);
  EXPECT_FALSE(read_sidecar_of(folder.path() / "city.json")) << "a JSON file is not its own";
  EXPECT_EQ(error_of([] {
              (void)parse_quilt_sidecar(std::string(40, '[') + std::string(40, ']'), "deep.json");
            }).what(),
            std::string("deep.json: nested too deeply"));
  std::ofstream(picture.string() + ".json") << R"({"mediaType": "quilt", "focus": 0.0, "zoom": 1,
      "quilt_settings": {"viewX": 8, "viewY": 2, "viewTotal": 16, "aspect": 0.5625}})";
  EXPECT_EQ(read_sidecar_of(picture).value().columns, 8) << "as Looking Glass libraries name it";
}

TEST(QuiltSidecar, StatesZoomAndDuration) {
  const QuiltSidecar sidecar =
      parsed(R"({"quilt_settings": {"viewX": 8, "viewY": 6}, "zoom": 1.5, "duration": 4.5})");
  EXPECT_EQ(sidecar.zoom, 1.5);
  EXPECT_EQ(sidecar.duration_s, 4.5);
  const QuiltSidecar neither = parsed(R"({"columns": 8, "rows": 6, "zoom": 0, "duration": 0})");
  EXPECT_FALSE(neither.duration_s) << "0 means not stated";
}

TEST(QuiltComment, IsReadFromTheHeadOfAPicture) {
  const test::ScratchFolder folder;
  const auto read = [&](const std::string& bytes) {
    std::ofstream(folder.path() / "city.jpg", std::ios::binary) << bytes;
    return read_quilt_comment(folder.path() / "city.jpg");
  };
  const std::string before("\xff\xd8\xff\xe1{\0}ASCII\0\0\0", 15), after("\xff\xdb}{", 4);
  const auto comment =
      read(before +
           R"({"LKGNumViews":45,"LKGRows":6,"LKGColumns":8,"LKGAspect":0.75,"LKGType":"Image"})" +
           after);
  ASSERT_TRUE(comment);
  EXPECT_EQ(comment->columns, 8);
  EXPECT_EQ(comment->rows, 6);
  EXPECT_EQ(comment->views, 45);
  EXPECT_EQ(comment->aspect, 0.75);
  EXPECT_FALSE(read(before + after));
  EXPECT_FALSE(read("\"LKGColumns\":8}")) << "not an object";
  EXPECT_FALSE(read("{\"LKGColumns\":8"));
  EXPECT_FALSE(read_quilt_comment(folder.path() / "none.jpg"));
  EXPECT_FALSE(read_quilt_comment(folder.path()));
  EXPECT_THAT(error_of([&] { (void)read("{\"LKGColumns\":-8,\"LKGRows\":2}"); }).what(),
              testing::HasSubstr("city.jpg: its comment: LKGColumns"));
}

}  // namespace
}  // namespace lenticule::frames
