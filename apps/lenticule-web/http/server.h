// SPDX-License-Identifier: Apache-2.0
// Server answers HTTP requests for a Site: it limits connections, sizes, times and rates, finds out
// who sent a request, and adds the headers that confine the pages.
//
// Each connection has a thread, so that a slow client delays only itself.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "apps/lenticule-web/http/access.h"
#include "apps/lenticule-web/http/clock.h"
#include "apps/lenticule-web/http/limits.h"
#include "apps/lenticule-web/http/listener.h"
#include "apps/lenticule-web/http/message.h"

struct MHD_Connection;
struct MHD_Daemon;

namespace lenticule::web {

struct ServerLimits {
  unsigned connections = 400;
  unsigned connections_per_address = 32;
  /// Time for the first line and the headers of a request, and between two requests.
  std::chrono::milliseconds head_time = std::chrono::seconds(10);
  /// Time without any byte after which a connection ends.
  std::chrono::seconds idle_time{20};
  /// A body must arrive at this rate, after `head_time`.
  uint64_t slowest_bytes_per_s = 16u << 10;
  std::chrono::milliseconds answer_time = std::chrono::seconds(60);
  size_t head_bytes = 16u << 10;
  double requests_burst = 200;
  double requests_per_s = 40;
  double wrong_tokens_burst = 10;
  double wrong_tokens_per_s = 0.1;
  unsigned streams = 32;
};

class Server {
 public:
  /// Begins to listen. Throws Error(Failed). Lifetime: `site`, `access` and `clock` must outlive
  /// the server. `clock` counts for the rates of requests; connections have the machine's time.
  Server(std::vector<Listener> listeners, Site& site, Access& access, ServerLimits limits = {},
         Clock& clock = machine_clock());
  /// Ends all connections.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  [[nodiscard]] size_t connections() const { return watch_.open(); }

 private:
  struct Call;
  struct Door;  // a listener and its daemon
  friend struct ServerCallbacks;

  [[nodiscard]] int handle(Door& door, MHD_Connection* connection, const char* url,
                           const char* method, const char* data, size_t* size, void** state);
  [[nodiscard]] int begin(Door& door, MHD_Connection* connection, const char* url,
                          const char* method, void** state);
  [[nodiscard]] int finish(MHD_Connection* connection, Call& call);
  [[nodiscard]] Response response_of(Call& call);
  void count_wrong_token(const std::string& peer);
  void identify(Call& call);
  void require_rights(Call& call) const;
  [[nodiscard]] Response enter(const Request& request);
  [[nodiscard]] int send(MHD_Connection* connection, Call& call, Response response);

  Site& site_;
  Access& access_;
  const ServerLimits limits_;
  Clock& clock_;
  RateLimit requests_;
  RateLimit wrong_tokens_;
  ConnectionWatch watch_;
  std::atomic<unsigned> streams_{0};
  std::vector<std::unique_ptr<Door>> doors_;  // last member: their threads use all above
};

}  // namespace lenticule::web
