// SPDX-License-Identifier: Apache-2.0
#include "player/proof/content_hash.h"

#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "frames/sequence/sequence_format.h"
#include "frames/sequence/sequence_writer.h"
#include "tests/support/comes_true.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

const std::atomic<bool> kGoesOn{false};

class ContentHash : public testing::Test {
 protected:
  test::ScratchFolder folder;

  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder.path() / name).string();
  }
  std::string write(const std::string& name, const std::string& bytes) const {
    std::ofstream(path(name), std::ios::binary) << bytes;
    return path(name);
  }
  std::string write_film(const std::string& name, uint8_t last_pixel) const {
    frames::WovenFrame frame({.width = 16, .height = 8});
    frames::SequenceWriter writer(path(name), {.geometry = frame.geometry(), .rate = {60, 1}},
                                  {.threads = 1});
    for (int k = 0; k < 5; ++k) {
      frame.bytes()[0] = static_cast<uint8_t>(k);
      frame.bytes().back() = k == 4 ? last_pixel : 0;
      writer.append(frame.view());
    }
    writer.finish();
    return path(name);
  }
  [[nodiscard]] static std::string hash_of(const std::string& source) {
    return content_hash(parse_source(source), kGoesOn);
  }
};

TEST_F(ContentHash, OfAPictureOrVideoIsThatOfSha256sum) {
  const std::string abc = "sha256:ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
  EXPECT_EQ(hash_of(write("film.mkv", "abc")), abc);
  EXPECT_EQ(hash_of(write("picture.png", "abc")), abc);
  EXPECT_EQ(hash_of(write("empty.png", "")),
            "sha256:e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST_F(ContentHash, OfASequenceDependsOnEveryPixel) {
  const std::string one = hash_of(write_film("one.lts", 0));
  EXPECT_TRUE(one.starts_with("lts-sha256:")) << one;
  EXPECT_EQ(one.size(), 11u + 64u);
  EXPECT_EQ(hash_of(write_film("same.lts", 0)), one);
  EXPECT_NE(hash_of(write_film("other.lts", 1)), one);
}

TEST_F(ContentHash, OfAPatternDependsOnItsFiles) {
  write("0.png", "a");
  write("1.png", "b");
  const std::string two = hash_of(path("%d.png"));
  EXPECT_TRUE(two.starts_with("files-sha256:")) << two;
  EXPECT_EQ(hash_of(path("%d.png")), two);
  write("2.png", "c");
  EXPECT_NE(hash_of(path("%d.png")), two);
}

TEST_F(ContentHash, IsEmptyForContentThatIsNotInFiles) {
  for (const char* const source : {"card", "black", "ring:/run/r.sock", "code:secret", "list.toml"})
    EXPECT_EQ(hash_of(source), "") << source;
}

TEST_F(ContentHash, OfAMissingFileIsAnError) {
  EXPECT_THROW((void)hash_of(path("missing.png")), Error);
  EXPECT_THROW((void)hash_of(write("broken.lts", "no film")), Error);
}

TEST_F(ContentHash, IsComputedInTheBackgroundAndAgainForAReplacedFile) {
  ContentHashes hashes;
  const SourceSpec source = parse_source(write("film.mkv", "abc"));
  EXPECT_EQ(hashes.of(source), "");
  for (const char* const content : {"abc", "another film"}) {
    const std::string hash = hash_of(write("film.mkv", content));
    hashes.request(source);
    EXPECT_TRUE(test::comes_true([&] { return hashes.of(source) == hash; })) << content;
  }
}

}  // namespace
}  // namespace lenticule::player
