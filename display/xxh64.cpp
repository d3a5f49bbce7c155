// SPDX-License-Identifier: Apache-2.0
#include "display/xxh64.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace lenticule::display {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr uint64_t kPrime1 = 0x9E3779B185EBCA87u;
constexpr uint64_t kPrime2 = 0xC2B2AE3D27D4EB4Fu;
constexpr uint64_t kPrime3 = 0x165667B19E3779F9u;
constexpr uint64_t kPrime4 = 0x85EBCA77C2B2AE63u;
constexpr uint64_t kPrime5 = 0x27D4EB2F165667C5u;

template <typename Word>
Word load(const uint8_t* bytes) noexcept {
  Word word;
  std::memcpy(&word, bytes, sizeof(word));
  return word;
}

uint64_t mix(uint64_t lane, uint64_t word) noexcept {
  return std::rotl(lane + word * kPrime2, 31) * kPrime1;
}

uint64_t merge(uint64_t hash, uint64_t lane) noexcept {
  return (hash ^ mix(0, lane)) * kPrime1 + kPrime4;
}

uint64_t avalanche(uint64_t hash) noexcept {
  hash = (hash ^ hash >> 33) * kPrime2;
  hash = (hash ^ hash >> 29) * kPrime3;
  return hash ^ hash >> 32;
}

uint64_t mix_tail(uint64_t hash, std::span<const uint8_t> tail) noexcept {
  for (; tail.size() >= 8; tail = tail.subspan(8))
    hash = std::rotl(hash ^ mix(0, load<uint64_t>(tail.data())), 27) * kPrime1 + kPrime4;
  if (tail.size() >= 4) {
    hash = std::rotl(hash ^ load<uint32_t>(tail.data()) * kPrime1, 23) * kPrime2 + kPrime3;
    tail = tail.subspan(4);
  }
  for (const uint8_t byte : tail) hash = std::rotl(hash ^ byte * kPrime5, 11) * kPrime1;
  return hash;
}

}  // namespace

void Xxh64::consume_stripe(const uint8_t* stripe) noexcept {
  for (size_t i = 0; i < lanes_.size(); ++i)
    lanes_[i] = mix(lanes_[i], load<uint64_t>(stripe + 8 * i));
}

void Xxh64::update(std::span<const uint8_t> bytes) noexcept {
  total_ += bytes.size();
  if (pending_size_ > 0) {
    const size_t taken = std::min(bytes.size(), kStripe - pending_size_);
    std::copy_n(bytes.begin(), taken, pending_.begin() + static_cast<ptrdiff_t>(pending_size_));
    pending_size_ += taken;
    bytes = bytes.subspan(taken);
    if (pending_size_ < kStripe) return;
    consume_stripe(pending_.data());
    pending_size_ = 0;
  }
  for (; bytes.size() >= kStripe; bytes = bytes.subspan(kStripe)) consume_stripe(bytes.data());
  std::copy(bytes.begin(), bytes.end(), pending_.begin());
  pending_size_ = bytes.size();
}

uint64_t Xxh64::digest() const noexcept {
  uint64_t hash = kPrime5;
  if (total_ >= kStripe) {
    hash = std::rotl(lanes_[0], 1) + std::rotl(lanes_[1], 7) + std::rotl(lanes_[2], 12) +
           std::rotl(lanes_[3], 18);
    for (const uint64_t lane : lanes_) hash = merge(hash, lane);
  }
  return avalanche(mix_tail(hash + total_, std::span(pending_).first(pending_size_)));
}

}  // namespace lenticule::display
