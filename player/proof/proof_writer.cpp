// SPDX-License-Identifier: Apache-2.0
// Entries need no place in the source.
#define SD_JOURNAL_SUPPRESS_LOCATION

#include "player/proof/proof_writer.h"

#include <sys/uio.h>
#include <systemd/sd-id128.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <utility>

#include "base/error.h"
#include "base/print.h"

namespace lenticule::player {
namespace {

constexpr size_t kMostWaiting = 1000;
constexpr std::chrono::seconds kEndTimeout{2};

}  // namespace

struct ProofWriter::Counts {
  std::atomic<uint64_t> written{0};
  std::atomic<uint64_t> lost{0};
};

ProofWriter::ProofWriter(Send send)
    : send_(std::move(send)), counts_(std::make_shared<Counts>()), worker_(kMostWaiting) {}

ProofWriter::~ProofWriter() {
  if (!worker_.wait(kEndTimeout))
    say("proof of play: the journal does not respond; the last entries are lost\n");
}

void ProofWriter::write(const ProofEntry& entry) {
  const bool posted = worker_.post(
      [fields = journal_fields(entry), send = send_, counts = counts_](const auto& ending) {
        (void)ending;
        if (send(fields))
          ++counts->written;
        else if (counts->lost++ == 0)
          say("proof of play: the journal of this machine takes no entry; 'lost' in the statistics "
              "counts them\n");
      });
  if (!posted) ++counts_->lost;
}

nlohmann::ordered_json ProofWriter::statistics() const {
  return {{"entries", counts_->written.load()}, {"lost", counts_->lost.load()}};
}

bool send_to_journal(const std::vector<std::string>& fields) {
  // Without the journal's socket, sd_journal_sendv() reports success.
  if (::access("/run/systemd/journal/socket", F_OK) != 0) return false;
  std::vector<iovec> parts;
  parts.reserve(fields.size());
  for (const std::string& field : fields)
    parts.push_back({.iov_base = const_cast<char*>(field.data()), .iov_len = field.size()});
  return sd_journal_sendv(parts.data(), static_cast<int>(parts.size())) >= 0;
}

std::string new_proof_session() {
  sd_id128_t id{};
  if (sd_id128_randomize(&id) < 0)
    throw Error(ErrorKind::Failed, "proof of play: the kernel gives no random number");
  std::array<char, SD_ID128_STRING_MAX> text{};
  return sd_id128_to_string(id, text.data());
}

}  // namespace lenticule::player
