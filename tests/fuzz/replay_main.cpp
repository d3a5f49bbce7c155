// SPDX-License-Identifier: Apache-2.0
// Runs a fuzz target over its seeds, and over simple mutations of them, where libFuzzer is not
// available. Fails if a named folder holds no seed: an empty corpus tests nothing.
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace {

std::vector<uint8_t> read_bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

void run_with_mutations(const std::vector<uint8_t>& seed, std::mt19937& random) {
  LLVMFuzzerTestOneInput(seed.data(), seed.size());
  for (int round = 0; round < 64; ++round) {
    std::vector<uint8_t> mutant = seed;
    if (round % 4 == 0) mutant.resize(seed.size() * (random() % 100) / 100);
    for (int flips = 0; flips < 3 && !mutant.empty(); ++flips)
      mutant[random() % mutant.size()] = static_cast<uint8_t>(random());
    LLVMFuzzerTestOneInput(mutant.data(), mutant.size());
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::mt19937 random(1);
  for (int i = 1; i < argc; ++i) {
    int seeds = 0;
    if (!std::filesystem::is_directory(argv[i])) {
      std::fprintf(stderr, "%s: no such folder of seeds\n", argv[i]);
      return 1;
    }
    for (const auto& entry : std::filesystem::directory_iterator(argv[i])) {
      run_with_mutations(read_bytes(entry.path()), random);
      ++seeds;
    }
    std::printf("%s: %d seeds\n", argv[i], seeds);
    if (seeds == 0) return 1;
  }
  return 0;
}
