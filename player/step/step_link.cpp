// SPDX-License-Identifier: Apache-2.0
#include "player/step/step_link.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/random.h>
#include <sys/stat.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/print.h"

namespace lenticule::player {
namespace {

using nlohmann::ordered_json;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;

constexpr nanoseconds kTick = milliseconds(100);
/// Datagrams handled before the clock is looked at again, so that a flood does not stop the ticks.
constexpr int kDatagramsAtOnce = 64;
constexpr size_t kLeastKeyBytes = 32;
constexpr uint64_t kMostKeyBytes = 4096;
constexpr double kMillion = 1e6;
/// The time for which a refusal is worth a report.
constexpr nanoseconds kTroubleLasts = std::chrono::seconds(5);

uint64_t random_session() {
  uint64_t session = 0;
  if (::getrandom(&session, sizeof session, 0) != static_cast<ssize_t>(sizeof session))
    throw Error(ErrorKind::Failed, "--step: the kernel has no random numbers");
  return session;
}

double milli(nanoseconds time) {
  return std::chrono::duration<double, std::milli>(time).count();
}

const char* state_of(const StepPlace& place, size_t peers) {
  if (peers == 0) return "alone";
  return place.in_step != 0 ? "in step" : "joining";
}

ordered_json json_of(const StepMessageCounts& counts, uint64_t sent) {
  return {{"sent", sent},
          {"accepted", counts.accepted},
          {"refused_format", counts.refused_format},
          {"refused_key", counts.refused_key},
          {"refused_group", counts.refused_group},
          {"refused_replayed", counts.refused_replayed},
          {"refused_untimely", counts.refused_untimely},
          {"refused_stranger", counts.refused_stranger}};
}

ordered_json json_of(const ClockAccuracy& accuracy, uint64_t steps) {
  return {{"synchronised", accuracy.synchronised},
          {"offset_us", accuracy.offset_us},
          {"estimated_error_us", accuracy.estimated_us},
          {"largest_error_us", accuracy.bound_us},
          {"steps", steps}};
}

}  // namespace

std::vector<uint8_t> read_step_key(const std::string& file) {
  std::vector<uint8_t> key = read_whole_file(file, kMostKeyBytes);
  if (key.size() < kLeastKeyBytes)
    throw Error(
        ErrorKind::Input,
        fmt::format("{}: has {} bytes; a key needs {} or more", file, key.size(), kLeastKeyBytes),
        "make one: head -c 32 /dev/urandom > step.key");
  struct stat status {};
  if (::stat(file.c_str(), &status) == 0 && (status.st_mode & S_IRWXO) != 0)
    throw Error(ErrorKind::Input, file + ": other users of this machine may use the key",
                "chmod o= " + file);
  return key;
}

StepLink::StepLink(const StepOptions& options)
    : options_(options), socket_(options.address, options.leader), clock_(read_clocks()) {
  const StepIdentity identity{
      .group = options.group, .key = StepKey(options.key), .session = random_session()};
  if (options.leader) {
    auto leader = std::make_unique<StepLeader>(identity, clock_.now(read_clocks()));
    leader_ = leader.get();
    member_ = std::move(leader);
  } else {
    member_ = std::make_unique<StepFollower>(identity);
  }
  thread_ = std::thread([this] { run(); });
}

StepLink::~StepLink() {
  stopping_.store(true);
  wake_.signal();
  thread_.join();
}

/// Runs until the link is destroyed. An exception here must not end the playback.
void StepLink::run() noexcept {
  nanoseconds next_tick{0};
  while (!stopping_.load()) {
    const nanoseconds left = next_tick - read_clocks().monotonic;
    const auto wait = std::chrono::ceil<milliseconds>(std::max(left, nanoseconds{0}));
    pollfd entries[2] = {{.fd = socket_.fd(), .events = POLLIN, .revents = 0},
                         {.fd = wake_.fd(), .events = POLLIN, .revents = 0}};
    (void)::poll(entries, 2, static_cast<int>(wait.count()));
    try {
      const StepNow now = clock_.now(read_clocks());
      receive_waiting(now);
      if (now.monotonic >= next_tick) {
        tick(now);
        next_tick = now.monotonic + kTick;
      }
    } catch (const std::exception& error) {
      say("step: {}\n", error.what());
    }
  }
}

void StepLink::receive_waiting(const StepNow& now) {
  for (int k = 0; k < kDatagramsAtOnce; ++k) {
    const auto datagram = socket_.receive();
    if (!datagram) return;
    const auto session = member_->receive(datagram->bytes, now);
    if (session && leader_ != nullptr) endpoints_[*session] = datagram->from;
  }
}

void StepLink::tick(const StepNow& now) {
  const StepPlace place = pacing_.place();
  std::erase_if(endpoints_, [&](const auto& entry) { return !member_->alive(entry.first, now); });
  uint64_t sent = 0;
  if (const auto message = member_->tick(place, now)) {
    if (leader_ == nullptr) {
      socket_.send(options_.address.endpoint, *message);
      ++sent;
    }
    for (const auto& [session, endpoint] : endpoints_) {
      socket_.send(endpoint, *message);
      ++sent;
    }
  }
  if (const auto& timeline = member_->timeline())
    pacing_.follow(timeline->on_clock_ahead_by(-clock_.ahead_of_monotonic()));
  {
    const std::lock_guard lock(mutex_);
    status_.sent += sent;
  }
  update_status(place, now);
}

void StepLink::update_status(const StepPlace& place, const StepNow& now) {
  Status status = this->status();
  if (member_->counts().refused_untimely > status.counts.refused_untimely)
    untimely_until_ = now.monotonic + kTroubleLasts;
  status.counts = member_->counts();
  status.peers = member_->peers(now);
  if (leader_ != nullptr) status.apart = leader_->apart(place, now);
  status.largest_apart = std::max(status.largest_apart, status.apart);
  status.clock_steps = clock_.steps();
  status.ahead_of_monotonic = clock_.ahead_of_monotonic();
  status.accuracy = read_clock_accuracy();
  status.trouble.clear();
  status.remedy.clear();
  find_trouble(place, now, status);
  const std::lock_guard lock(mutex_);
  status_ = std::move(status);
}

/// Names the first thing that keeps the players apart, and its remedy.
void StepLink::find_trouble(const StepPlace& place, const StepNow& now, Status& status) const {
  const nanoseconds half_vblank{place.period_ns / 2};
  const auto bound = std::chrono::microseconds(status.accuracy.bound_us);
  const uint64_t frames = member_->timeline() ? member_->timeline()->loop_frames : 0;
  if (frames > 0 && place.loop_frames > 0 && frames != place.loop_frames) {
    status.trouble =
        fmt::format("this film has {} frames, that of the group has {}", place.loop_frames, frames);
    status.remedy = "play films of the same length and rate on all players";
  } else if (options_.address.is_unix) {
    return;  // one machine has one clock
  } else if (now.monotonic < untimely_until_) {
    status.trouble = fmt::format(
        "messages are {:.0f} ms old by this machine's clock, and refused: the clocks differ",
        milli(member_->untimely_age()));
    status.remedy = "let chrony or PTP set the clock of each machine; see: chronyc tracking";
  } else if (!status.accuracy.synchronised) {
    status.trouble = "the clock of this machine is not synchronised";
    status.remedy = "run chrony or PTP on each machine; see: chronyc tracking";
  } else if (half_vblank > nanoseconds{0} && bound > half_vblank) {
    status.trouble = fmt::format(
        "the clock of this machine may be wrong by {:.1f} ms, more than half a "
        "vblank ({:.1f} ms)",
        milli(bound), milli(half_vblank));
    status.remedy = "use a time server in the local network, or PTP";
  }
}

StepLink::Status StepLink::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void StepLink::report_trouble() {
  const Status now = status();
  // The figures in a text change all the time; a kind of trouble is reported once.
  if (std::exchange(reported_, now.remedy) == now.remedy) return;
  if (now.trouble.empty())
    say("step: the group can be followed again\n");
  else
    say("step: {}; {}\n", now.trouble, now.remedy);
}

ordered_json StepLink::statistics() const {
  const Status now = status();
  const StepPlace place = pacing_.place();
  ordered_json json = {
      {"group", options_.group},
      {"role", options_.leader ? "leader" : "follower"},
      {"state", state_of(place, now.peers)},
      {"peers", now.peers},
      {"difference_vblanks", static_cast<double>(place.difference) / kMillion},
      {"largest_difference_vblanks", static_cast<double>(place.largest_difference) / kMillion},
      {"repeated", place.repeated},
      {"dropped", place.dropped},
      {"joined", place.joined},
      {"drift_ppm", static_cast<double>(place.drift_ppb) / 1000.0}};
  if (options_.leader) {
    json["apart_vblanks"] = static_cast<double>(now.apart) / kMillion;
    json["largest_apart_vblanks"] = static_cast<double>(now.largest_apart) / kMillion;
  }
  if (place.shown_ns != 0)
    json["shown"] = {{"frame", place.shown_frame},
                     {"time_ns", place.shown_ns + now.ahead_of_monotonic.count()}};
  json["messages"] = json_of(now.counts, now.sent);
  json["clock"] = json_of(now.accuracy, now.clock_steps);
  json["trouble"] = now.trouble;
  return json;
}

}  // namespace lenticule::player
