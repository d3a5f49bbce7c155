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

/// Expects the hashes of `group`, by the names of its frames, to be the committed ones.
inline void expect_committed(const std::string& group, const Hashes& hashes) {
  const std::string file =
      std::string(LENTICULE_SOURCE_DIR) + "/tests/golden/frames/hashes/" + group + ".txt";
  if (const char* renew = std::getenv("LENTICULE_RENEW_FRAMES"); renew && *renew) {
    std::ofstream out(file);
    for (const auto& [name, hash] : hashes) out << hash << ' ' << name << '\n';
    ASSERT_TRUE(out.flush().good()) << file;
  }
  Hashes expected;
  std::ifstream in(file);
  for (std::string hash, name; in >> hash && std::getline(in >> std::ws, name);)
    expected[name] = hash;
  EXPECT_EQ(hashes, expected)
      << "frames changed; if that is wanted, run this test with LENTICULE_RENEW_FRAMES=1";
}

}  // namespace lenticule::test
