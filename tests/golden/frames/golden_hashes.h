// SPDX-License-Identifier: Apache-2.0
// Compares hashes of frames with the committed values in hashes/GROUP.txt, so that a change of a
// byte is noticed. If the change is wanted, run the test with LENTICULE_RENEW_FRAMES=1 in the
// environment, which rewrites the file, and commit it.
//
// A rendered frame has a digit for each of 32 parts, too. Where a ray meets two triangles at their
// common edge, Embree's choice depends on the manufacturer of the processor: on a processor of
// another one than the file's, a few parts may differ (docs/measurements/same-bytes.md).
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

constexpr size_t kParts = 32;

/// Returns the hash, and a hexadecimal digit for the hash of each part: "HASH:DIGITS".
[[nodiscard]] inline std::string hash_of_rendered(std::span<const uint8_t> bytes) {
  std::string out = hash_of(bytes) + ':';
  for (size_t n = 0; n < kParts; ++n) {
    const size_t begin = bytes.size() * n / kParts, end = bytes.size() * (n + 1) / kParts;
    out += hash_of(bytes.subspan(begin, end - begin)).back();
  }
  return out;
}

[[nodiscard]] inline std::string hash_of_text(const std::string& bytes) {
  return hash_of_rendered(std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()));
}

[[nodiscard]] inline std::string hash_of_file(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  EXPECT_TRUE(in.good()) << file;
  return hash_of_text(std::string{std::istreambuf_iterator<char>(in), {}});
}

/// Returns the processor's manufacturer, such as "GenuineIntel".
[[nodiscard]] inline std::string processor_maker() {
  std::ifstream in("/proc/cpuinfo");
  for (std::string word, maker; in >> word;)
    if (word == "vendor_id" && in >> word >> maker) return maker;
  return "unknown";
}

/// Returns true if two values of hash_of_rendered() agree in all but a few parts.
[[nodiscard]] inline bool nearly_equal(const std::string& a, const std::string& b) {
  constexpr size_t kMayDiffer = 4;
  const size_t digits = a.find(':');
  if (digits == std::string::npos || a.size() != b.size()) return false;
  size_t differing = 0;
  for (size_t n = digits; n < a.size(); ++n) differing += a[n] != b[n] ? 1 : 0;
  return differing <= kMayDiffer;
}

using Hashes = std::map<std::string, std::string>;

/// Expects the hashes of `group`, by the names of its frames, to be the committed ones.
inline void expect_committed(const std::string& group, const Hashes& hashes) {
  const std::string file =
      std::string(LENTICULE_SOURCE_DIR) + "/tests/golden/frames/hashes/" + group + ".txt";
  if (const char* renew = std::getenv("LENTICULE_RENEW_FRAMES"); renew && *renew) {
    std::ofstream out(file);
    out << processor_maker() << '\n';
    for (const auto& [name, hash] : hashes) out << hash << ' ' << name << '\n';
    ASSERT_TRUE(out.flush().good()) << file;
  }
  std::ifstream in(file);
  std::string maker;
  in >> maker;
  size_t committed = 0, nearly = 0;
  for (std::string value, name; in >> value && std::getline(in >> std::ws, name); ++committed) {
    const auto found = hashes.find(name);
    ASSERT_NE(found, hashes.end()) << name << ": no such frame any more";
    if (value == found->second) continue;
    const bool may_differ = maker != processor_maker() && nearly_equal(value, found->second);
    nearly += may_differ ? 1 : 0;
    const std::string what =
        fmt::format("{} has changed from {} to {}", name, value, found->second);
    if (may_differ)
      fmt::print("{}: a ray at an edge, on a processor of another maker\n", what);
    else
      ADD_FAILURE() << what << "; if that is wanted, run this test with LENTICULE_RENEW_FRAMES=1";
  }
  EXPECT_LE(nearly, hashes.size() / 4) << "rays at edges are rare";
  EXPECT_EQ(committed, hashes.size()) << "a frame has no committed hash";
}

}  // namespace lenticule::test
