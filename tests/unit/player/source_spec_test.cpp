// SPDX-License-Identifier: Apache-2.0
#include "player/sources/source_spec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/gif_maker.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

TEST(SourceSpec, TheNameDecidesTheKind) {
  const auto kind = [](const char* text) { return parse_source(text).kind; };
  EXPECT_EQ(kind("card"), SourceKind::Card);
  EXPECT_EQ(kind("black"), SourceKind::Black);
  EXPECT_EQ(kind("views"), SourceKind::RigViews);
  EXPECT_EQ(kind("code:http://panel/a.toml"), SourceKind::Code);
  EXPECT_EQ(kind("ring:/run/panel"), SourceKind::Ring);
  EXPECT_EQ(kind("views:left.mkv|right.mkv"), SourceKind::ViewFiles);
  EXPECT_EQ(kind("evening.toml"), SourceKind::List);
  EXPECT_EQ(kind("evening.m3u8"), SourceKind::List);
  EXPECT_EQ(kind("playlist.JSON"), SourceKind::List);
  EXPECT_EQ(kind("film.lts"), SourceKind::Sequence);
  EXPECT_EQ(kind("film.lts.part"), SourceKind::Sequence);
  EXPECT_EQ(kind("film.MKV"), SourceKind::Video);
  EXPECT_EQ(kind("film.gif"), SourceKind::Video);
  EXPECT_EQ(kind("FILM.LTS"), SourceKind::Sequence);
  EXPECT_EQ(kind("EVENING.TOML"), SourceKind::List);
  EXPECT_EQ(kind("out/%05d.png"), SourceKind::Pictures);
  EXPECT_EQ(kind("./card"), SourceKind::Pictures);
  EXPECT_EQ(kind(""), SourceKind::Pictures);
}

TEST(SourceSpec, AGifOfOnePictureIsAPicture) {
  const test::ScratchFolder folder;
  test::write_bytes(folder / "still.gif", test::gif_of(1));
  test::write_bytes(folder / "moves.GIF", test::gif_of(2));
  EXPECT_EQ(kind_of_file(folder / "still.gif"), SourceKind::Pictures);
  EXPECT_EQ(parse_source("still.gif", {}, folder.path()).kind, SourceKind::Pictures);
  EXPECT_EQ(kind_of_file(folder / "moves.GIF"), SourceKind::Video);
}

TEST(SourceSpec, AFolderIsPlayedAsAListWithOrWithoutASlash) {
  EXPECT_EQ(parse_source("films/").kind, SourceKind::List);
  EXPECT_EQ(parse_source("films/").in_folder("/media").text, "/media/films/");
  EXPECT_EQ(parse_source("/proc/self"), parse_source("/proc/self/"));
  EXPECT_EQ(parse_source("self", {}, "/proc"), parse_source("self/"));
}

TEST(SourceSpec, APrefixDecidesBeforeAnExtension) {
  EXPECT_EQ(parse_source("ring:panel.toml").kind, SourceKind::Ring);
  EXPECT_EQ(parse_source("views:a.lts").kind, SourceKind::ViewFiles);
}

TEST(SourceSpec, NamesItsFiles) {
  const auto files = [](const char* text) { return parse_source(text).files(); };
  EXPECT_THAT(files("a|b.png"), testing::ElementsAre("a|b.png"));
  EXPECT_THAT(files("views:left.png|/right.png"), testing::ElementsAre("left.png", "/right.png"));
  EXPECT_THAT(files("views:v%02d/%05d.png"), testing::ElementsAre("v%02d/%05d.png"));
  EXPECT_THAT(files("list.toml"), testing::ElementsAre("list.toml"));
  for (const char* text : {"card", "black", "views", "code:a.png", "ring:panel"})
    EXPECT_THAT(files(text), testing::IsEmpty()) << text;
}

TEST(SourceSpec, OnlyFilesOfPicturesHavePictures) {
  for (const char* text : {"a.png", "a.lts", "a.mkv", "views:a|b"})
    EXPECT_TRUE(parse_source(text).has_pictures()) << text;
  for (const char* text : {"card", "black", "views", "code:a.png", "ring:panel", "list.toml"})
    EXPECT_FALSE(parse_source(text).has_pictures()) << text;
}

TEST(SourceSpec, ResolvesRelativeFilesAgainstAFolder) {
  const auto in_films = [](const char* text) {
    return parse_source(text).in_folder("/films").text;
  };
  EXPECT_EQ(in_films("a.png"), "/films/a.png");
  EXPECT_EQ(in_films("/a.png"), "/a.png");
  EXPECT_EQ(in_films("evening.toml"), "/films/evening.toml");
  EXPECT_EQ(in_films("views:left.mkv|/b/right.mkv"), "views:/films/left.mkv|/b/right.mkv");
  for (const char* text : {"card", "black", "views", "ring:panel"}) EXPECT_EQ(in_films(text), text);
}

TEST(SourceSpec, TheTextOfACodeIsNotItsName) {
  const SourceSpec code = parse_source("code:http://panel/enter?token=secret");
  EXPECT_EQ(code.text, "code");
  EXPECT_EQ(code.coded, "http://panel/enter?token=secret");
  EXPECT_EQ(code.in_folder("/films"), code);
  EXPECT_EQ(parse_source("code").coded, "");
}

}  // namespace
}  // namespace lenticule::player
