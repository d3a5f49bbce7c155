// SPDX-License-Identifier: Apache-2.0
// Compares hashes of frames with the committed values in hashes/GROUP.txt, so that a change of a
// byte is noticed. If the change is wanted, run the test with LENTICULE_RENEW_FRAMES=1 in the
// environment, which rewrites the file, and commit it.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <span>
#include <string>

namespace lenticule::test {

/// Returns the FNV-1a hash.
[[nodiscard]] inline std::string hash_of(std::span<const uint8_t> bytes) {
  uint64_t hash = 0xcbf29ce484222325U;
  for (const uint8_t byte : bytes) hash = (hash ^ byte) * 0x100000001b3U;
  return fmt::format("{:016x}", hash);
}

[[nodiscard]] inline std::string hash_of_file(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  EXPECT_TRUE(in.good()) << file;
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  return hash_of(std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()));
}

using Hashes = std::map<std::string, std::string>;

/// Expects the hashes of `group`, by the names of its frames, to be the committed ones. A line with
/// two, "HASH|HASH NAME", is a frame in which a ray meets two triangles at their common edge:
/// processors of two manufacturers see another of them (docs/measurements/same-bytes.md).
inline void expect_committed(const std::string& group, const Hashes& hashes) {
  const std::string file =
      std::string(LENTICULE_SOURCE_DIR) + "/tests/golden/frames/hashes/" + group + ".txt";
  if (const char* renew = std::getenv("LENTICULE_RENEW_FRAMES"); renew && *renew) {
    std::ofstream out(file);
    for (const auto& [name, hash] : hashes) out << hash << ' ' << name << '\n';
    ASSERT_TRUE(out.flush().good()) << file;
  }
  std::ifstream in(file);
  size_t committed = 0;
  for (std::string values, name; in >> values && std::getline(in >> std::ws, name); ++committed) {
    const auto found = hashes.find(name);
    ASSERT_NE(found, hashes.end()) << name << ": no such frame any more";
    EXPECT_NE(values.find(found->second), std::string::npos)
        << name << " has changed from " << values << " to " << found->second
        << "; if that is wanted, run this test with LENTICULE_RENEW_FRAMES=1";
  }
  EXPECT_EQ(committed, hashes.size()) << "a frame has no committed hash";
}

}  // namespace lenticule::test
