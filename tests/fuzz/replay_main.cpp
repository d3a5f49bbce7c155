// SPDX-License-Identifier: Apache-2.0
// Runs a fuzz target over its seeds, over simple mutations of them and over those of the target's
// own mutator, where libFuzzer is not available. Fails if a named folder holds no seed: an empty
// corpus tests nothing.
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);
extern "C" size_t LLVMFuzzerMutate(uint8_t* data, size_t size, size_t max_size);
/// Only targets with structured input define it.
extern "C" [[gnu::weak]] size_t LLVMFuzzerCustomMutator(uint8_t* data, size_t size, size_t max_size,
                                                        unsigned int seed);

namespace {

std::mt19937 bytes_random(2);

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
  if (LLVMFuzzerCustomMutator == nullptr) return;
  for (int round = 0; round < 64; ++round) {
    std::vector<uint8_t> mutant = seed;
    mutant.resize(seed.size() + 4096);
    const size_t size = LLVMFuzzerCustomMutator(mutant.data(), seed.size(), mutant.size(),
                                                static_cast<unsigned int>(random()));
    LLVMFuzzerTestOneInput(mutant.data(), size);
  }
}

}  // namespace

/// Takes the place of libFuzzer's function: changes one byte.
extern "C" size_t LLVMFuzzerMutate(uint8_t* data, size_t size, size_t /*max_size*/) {
  if (size > 0) data[bytes_random() % size] = static_cast<uint8_t>(bytes_random());
  return size;
}

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
