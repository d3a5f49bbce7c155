// SPDX-License-Identifier: Apache-2.0
#include "player/session/stored_output.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <optional>
#include <span>
#include <utility>

namespace lenticule::player {
namespace {

constexpr const char* kCardName = "lenticule-card";
constexpr const char* kStateName = "lenticule-output";

/// Creates the state file, sealed, so that the successor uses exactly the bytes that it has
/// checked. Empty on failure.
UniqueFd state_file(const display::TakeoverState& state) {
  UniqueFd file(memfd_create(kStateName, MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!file) return {};
  const auto bytes = display::bytes_of(state);
  if (write(file.get(), bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size()))
    return {};
  if (fcntl(file.get(), F_ADD_SEALS, F_SEAL_WRITE | F_SEAL_GROW | F_SEAL_SHRINK | F_SEAL_SEAL) != 0)
    return {};
  return file;
}

std::optional<display::TakeoverState> read_state(int file) {
  // One extra byte detects a file that is too long.
  std::array<uint8_t, sizeof(display::TakeoverState) + 1> bytes{};
  const ssize_t size = pread(file, bytes.data(), bytes.size(), 0);
  if (size < 0) return std::nullopt;
  return display::parse_takeover_state(std::span(bytes.data(), static_cast<size_t>(size)));
}

}  // namespace

void store_output(const ServiceManager& manager, const display::KmsDisplay& display) {
  if (!manager.present()) return;
  const UniqueFd state = state_file(display.takeover_state());
  if (!state) return forget_output(manager);
  manager.keep(kCardName, display.card_fd());
  manager.keep(kStateName, state.get());
}

void forget_output(const ServiceManager& manager) {
  manager.forget(kCardName);
  manager.forget(kStateName);
}

std::shared_ptr<display::PreviousOutput> stored_output(std::vector<StoredDescriptor> descriptors) {
  auto output = std::make_shared<display::PreviousOutput>();
  std::optional<display::TakeoverState> state;
  for (StoredDescriptor& descriptor : descriptors) {
    if (descriptor.name == kCardName) output->card = std::move(descriptor.fd);
    if (descriptor.name == kStateName) state = read_state(descriptor.fd.get());
  }
  if (!output->card || !state) return nullptr;
  output->state = *state;
  return output;
}

}  // namespace lenticule::player
