// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/farm/simulation.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <queue>
#include <random>
#include <vector>

#include "farm/plan.h"
#include "frames/sequence/predictor_choice.h"

namespace lenticule::player {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kHour = 3600.0;

/// Server does one piece of work after another.
struct Server {
  double free_at = 0.0;
  double busy = 0.0;

  /// Returns the end of a piece that arrives at `now`.
  double serve(double now, double seconds) {
    free_at = std::max(now, free_at) + seconds;
    busy += seconds;
    return free_at;
  }
};

enum class Step { Ask, Read, Render, Write, Done, Fail, Return };

struct Event {
  double time = 0.0;
  Step step = Step::Ask;
  uint64_t node = 0;
  uint64_t life = 0;  ///< events of a node that has failed since then are void
  friend bool operator>(const Event& a, const Event& b) { return a.time > b.time; }
};

struct Node {
  uint64_t life = 0;
  uint64_t chunk = 0;
  bool working = false;
  double began = 0.0;
};

class Simulation {
 public:
  explicit Simulation(const SimulatedFarm& simulated) : farm_(simulated), random_(simulated.seed) {
    chunks_ = (farm_.frames + farm_.chunk_frames - 1) / farm_.chunk_frames;
    farm::Plan plan;
    plan.end = farm_.frames;
    plan.chunk_frames = farm_.chunk_frames;
    for (const uint64_t chunk : farm::chunk_order(plan)) waiting_.push_back(chunk);
    nodes_.resize(farm_.nodes);
    tables_.assign(farm_.frames / frames::kPredictorInterval + 1, kNever);
  }

  SimulatedRun run() {
    for (uint64_t node = 0; node < farm_.nodes; ++node) {
      push(0.0, Step::Ask, node);
      push_failure(0.0, node);
    }
    while (done_ < chunks_ && !events_.empty()) {
      const Event event = events_.top();
      events_.pop();
      if (event.life == nodes_[event.node].life) handle(event);
    }
    return result();
  }

 private:
  void push(double time, Step step, uint64_t node) {
    events_.push({time, step, node, nodes_[node].life});
  }

  void push_failure(double now, uint64_t node) {
    if (farm_.failures_per_hour <= 0.0) return;
    std::exponential_distribution<double> hours(farm_.failures_per_hour);
    push(now + kHour * hours(random_), Step::Fail, node);
  }

  [[nodiscard]] uint64_t frames_of(uint64_t chunk) const {
    const uint64_t begin = chunk * farm_.chunk_frames;
    return std::min(farm_.chunk_frames, farm_.frames - begin);
  }

  double transfer(double now, double bytes) {
    const double shared = store_.serve(now, bytes / farm_.store_bytes_per_second);
    return std::max(shared, now + bytes / farm_.node_bytes_per_second);
  }

  double look_up(double now) {
    return metadata_.serve(now, 0.5 * farm_.metadata_per_chunk / farm_.metadata_per_second);
  }

  void publish(uint64_t interval, double time) {
    tables_[interval] = std::min(tables_[interval], time);
  }

  /// Returns the time of the chunk's frames, and of a frame that chooses predictors if no other
  /// chunk has published them.
  double render_time(double now, uint64_t chunk) {
    std::normal_distribution<double> speed(1.0, farm_.frame_spread);
    const double frame = farm_.frame_seconds * std::max(0.2, speed(random_));
    const uint64_t begin = chunk * farm_.chunk_frames;
    const uint64_t interval = begin / frames::kPredictorInterval;
    double extra = 0.0;
    if (begin % frames::kPredictorInterval != 0 && tables_[interval] > now) {
      extra = frame;
      repeated_ += frame;
      publish(interval, now + extra);
    }
    const uint64_t next = (begin + frames::kPredictorInterval - 1) / frames::kPredictorInterval;
    for (uint64_t own = next; own * frames::kPredictorInterval < begin + frames_of(chunk); ++own)
      publish(own, now + extra +
                       frame * static_cast<double>(own * frames::kPredictorInterval + 1 - begin));
    return extra + frame * static_cast<double>(frames_of(chunk));
  }

  void handle(const Event& event) {
    Node& node = nodes_[event.node];
    switch (event.step) {
      case Step::Ask: {
        release_lost(event.time);
        if (waiting_.empty()) {  // looks again: a chunk may be lost
          if (done_ + running_ < chunks_ || running_ > 0)
            push(event.time + farm_.detect_seconds / 4.0, Step::Ask, event.node);
          return;
        }
        node.chunk = waiting_.front();
        waiting_.pop_front();
        node.working = true;
        node.began = event.time;
        ++running_;
        const double started = scheduler_.serve(event.time, 1.0 / farm_.starts_per_second);
        push(started + farm_.start_seconds, Step::Read, event.node);
        return;
      }
      case Step::Read:
        push(transfer(look_up(event.time), farm_.scene_bytes), Step::Render, event.node);
        return;
      case Step::Render:
        push(event.time + render_time(event.time, node.chunk), Step::Write, event.node);
        return;
      case Step::Write:
        push(transfer(look_up(event.time),
                      farm_.frame_bytes * static_cast<double>(frames_of(node.chunk))),
             Step::Done, event.node);
        return;
      case Step::Done:
        node.working = false;
        --running_;
        ++done_;
        end_ = event.time;
        push(event.time, Step::Ask, event.node);
        return;
      case Step::Fail:
        fail(event, node);
        return;
      case Step::Return:
        push(event.time, Step::Ask, event.node);
        push_failure(event.time, event.node);
        return;
    }
  }

  void fail(const Event& event, Node& node) {
    ++failures_;
    ++node.life;
    if (node.working) {
      node.working = false;
      --running_;
      lost_ += event.time - node.began;
      lost_chunks_.push_back({event.time + farm_.detect_seconds, node.chunk});
    }
    push(event.time + farm_.repair_seconds, Step::Return, event.node);
  }

  void release_lost(double now) {
    while (!lost_chunks_.empty() && lost_chunks_.front().first <= now) {
      waiting_.push_front(lost_chunks_.front().second);
      lost_chunks_.pop_front();
    }
  }

  [[nodiscard]] SimulatedRun result() const {
    const double work = farm_.frame_seconds * static_cast<double>(farm_.frames);
    const double total = std::max(end_, 1e-9);
    return {.render_seconds = end_,
            .merge_seconds = farm_.frame_bytes * static_cast<double>(farm_.frames) /
                             farm_.merge_bytes_per_second,
            .efficiency = work / (static_cast<double>(farm_.nodes) * total),
            .store_busy = store_.busy / total,
            .metadata_busy = metadata_.busy / total,
            .scheduler_busy = scheduler_.busy / total,
            .lost = lost_ / work,
            .repeated = repeated_ / work,
            .failures = failures_};
  }

  const SimulatedFarm& farm_;
  std::mt19937_64 random_;
  uint64_t chunks_ = 0;
  std::deque<uint64_t> waiting_;
  std::deque<std::pair<double, uint64_t>> lost_chunks_;
  std::vector<Node> nodes_;
  std::vector<double> tables_;  ///< time at which the predictors of an interval are published
  std::priority_queue<Event, std::vector<Event>, std::greater<>> events_;
  Server scheduler_, store_, metadata_;
  uint64_t done_ = 0, running_ = 0, failures_ = 0;
  double end_ = 0.0, lost_ = 0.0, repeated_ = 0.0;
};

}  // namespace

SimulatedRun simulate_farm(const SimulatedFarm& farm) {
  return Simulation(farm).run();
}

}  // namespace lenticule::player
