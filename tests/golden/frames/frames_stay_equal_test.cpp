// SPDX-License-Identifier: Apache-2.0
// Compares hashes of rendered, woven and played frames with the committed values in
// frames_stay_equal.txt, so that a change of a byte is noticed. If the change is wanted, run this
// test with LENTICULE_RENEW_FRAMES=1 in the environment, which rewrites the file, and commit it.
//
// Our kernels give the same bits with every instruction set. Embree's kernels for triangles do not
// (they may contract a*b+c, depending on version and processor), so the scenes here are those whose
// bytes are equal with Embree's kernels for SSE2, AVX2 and AVX-512. Another version of Embree may
// still require new values.
#include <fmt/format.h>

#include <cstdlib>
#include <map>
#include <sstream>

#include "tests/commands/program.h"

namespace lenticule::test {
namespace {

std::string bytes_of(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream bytes;
  bytes << in.rdbuf();
  EXPECT_TRUE(in.good()) << file;
  return bytes.str();
}

/// Returns the FNV-1a hash.
std::string hash_of(const std::string& bytes) {
  uint64_t hash = 0xcbf29ce484222325U;
  for (const char c : bytes) hash = (hash ^ static_cast<uint8_t>(c)) * 0x100000001b3U;
  return fmt::format("{:016x}", hash);
}

using Hashes = std::map<std::string, std::string>;

class FramesStayEqual : public CommandTest {
 protected:
  /// Renders frames 0 and 1 into one sequence of pictures.
  void render(const std::string& name, const std::string& scene, const std::string& rig,
              std::vector<std::string> more) {
    std::vector<std::string> arguments = {"render",   "builtin:" + scene,
                                          "--rig",    source_file("scenes/rigs/" + rig + ".toml"),
                                          "--frames", "0:2",
                                          "-o",       path(name + "_%d.ppm")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProcessResult done = run(arguments);
    ASSERT_EQ(done.exit_code, 0) << name << ": " << done.err;
    for (const char* number : {"0", "1"})
      hashes_["render " + name + " " + number] =
          hash_of(bytes_of(path(name + "_" + number + ".ppm")));
  }

  Hashes hashes_;
};

TEST_F(FramesStayEqual, TheirHashesAreTheCommittedOnes) {
  const std::string rig = source_file("scenes/rigs/tiny.toml");
  for (const char* method :
       {"full", "adaptive", "lens-view", "interpolate", "temporal", "hybrid"}) {
    render(fmt::format("balls_{}", method), "balls:1", "tiny", {"--method", method});
    render(fmt::format("tree_{}", method), "tree:1", "tiny", {"--method", method});
  }
  render("balls_soft", "balls:1", "tiny", {"--method", "full", "--soft-shadows", "4"});
  render("demo_adaptive", "demo", "tiny", {"--method", "adaptive"});

  const ProcessResult woven =
      run({"weave", path("tree_full_0.ppm"), "--grid", "4x2", "--rig", rig, "-o", path("w.ppm")});
  ASSERT_EQ(woven.exit_code, 0) << woven.err;
  hashes_["weave"] = hash_of(bytes_of(path("w.ppm")));

  const ProcessResult played =
      run({"play", path("balls_full_%d.ppm"), "--rig", rig, "--fps", "30", "--display", "virtual",
           "--clock", "simulated", "--loop", "2", "--record", "checksums:" + path("shown.txt")});
  ASSERT_EQ(played.exit_code, 0) << played.err;
  hashes_["play"] = hash_of(bytes_of(path("shown.txt")));

  const std::string values = source_file("tests/golden/frames/frames_stay_equal.txt");
  if (const char* renew = std::getenv("LENTICULE_RENEW_FRAMES"); renew && *renew) {
    std::ofstream out(values);
    for (const auto& [name, hash] : hashes_) out << hash << ' ' << name << '\n';
    ASSERT_TRUE(out.flush().good()) << values;
  }
  Hashes expected;
  std::ifstream in(values);
  for (std::string hash, name; in >> hash && std::getline(in >> std::ws, name);)
    expected[name] = hash;
  EXPECT_EQ(hashes_, expected)
      << "frames changed; if that is wanted, run this test with LENTICULE_RENEW_FRAMES=1";
}

}  // namespace
}  // namespace lenticule::test
