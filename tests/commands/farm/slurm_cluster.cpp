// SPDX-License-Identifier: Apache-2.0
#include "slurm_cluster.h"

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <fstream>
#include <iterator>
#include <random>
#include <stdexcept>

#include "tests/support/scratch_folder.h"

namespace lenticule::test {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kStart{60};
const std::array kNodes = {"n1", "n2"};

std::string output_of(const std::string& command) {
  std::string out = run_process({"/bin/sh", "-c", command}).out;
  while (!out.empty() && out.back() == '\n') out.pop_back();
  return out;
}

bool is_free(int port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<uint16_t>(port));
  const bool free = ::bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  ::close(fd);
  return free;
}

/// Returns a port of this machine that is free at the moment, below those that the kernel gives to
/// connections: a daemon that is started again must find its port free.
int free_port() {
  std::random_device random;
  std::uniform_int_distribution<int> any(15000, 32000);
  for (int trial = 0; trial < 100; ++trial)
    if (const int port = any(random); is_free(port)) return port;
  throw std::runtime_error("no free port");
}

}  // namespace

bool SlurmCluster::installed() {
  constexpr std::array kPrograms = {"/usr/sbin/munged", "/usr/sbin/slurmctld", "/usr/sbin/slurmd",
                                    "/usr/bin/sbatch"};
  return std::all_of(kPrograms.begin(), kPrograms.end(),
                     [](const char* program) { return fs::exists(program); });
}

SlurmCluster::SlurmCluster(int node_seconds)
    : folder_(scratch_.path()), node_seconds_(node_seconds) {
  for (const char* part : {"state", "n1", "n2", "log"}) fs::create_directories(folder_ / part);
  std::random_device random;
  {
    std::ofstream key(folder_ / "munge.key", std::ios::binary);
    for (int i = 0; i < 128; ++i) key.put(static_cast<char>(random()));
  }
  fs::permissions(folder_ / "munge.key", fs::perms::owner_read | fs::perms::owner_write);
  std::ofstream(folder_ / "prolog.sh")
      << "#!/bin/sh\ntest ! -e '" << folder_.string() << "/launches-fail'\n";
  fs::permissions(folder_ / "prolog.sh", fs::perms::owner_all);
  write_configuration();
  const std::string files = folder_.string() + "/munge.";
  start("munged", "/usr/sbin/munged --foreground --force --key-file=" + files +
                      "key --socket=" + files + "sock --pid-file=" + files +
                      "pid --log-file=" + files + "log --seed-file=" + files + "seed");
  if (!comes_true([&] { return fs::exists(files + "sock"); }, kPause, kStart))
    throw std::runtime_error("munged does not start: " + logs());
  start_controller();
  for (const char* node : kNodes) start_node(node);
  const auto idle = [&] { return run({"/usr/bin/sinfo", "-h", "-t", "idle", "-o", "%D"}).out; };
  if (!comes_true([&] { return idle() == "2\n"; }, kPause, kStart))
    throw std::runtime_error("Slurm does not start: " + logs());
}

SlurmCluster::~SlurmCluster() {
  // Tasks outlive their daemons, so they must end first.
  (void)run({"/usr/bin/scancel", "--user=" + output_of("id -un"), "--signal=KILL"});
  (void)run({"/usr/bin/scancel", "--user=" + output_of("id -un")});
  (void)comes_true([&] { return queued() == 0; }, kPause, std::chrono::seconds(10));
}

/// Timeouts are as short as Slurm allows. A job that lost its node begins again when its credential
/// has expired, after two minutes by default.
void SlurmCluster::write_configuration() const {
  const std::string host = output_of("hostname -s");
  const std::string user = output_of("id -un");
  const std::string at = folder_.string();
  std::ofstream conf(folder_ / "slurm.conf");
  conf << "ClusterName=test\n"
       << "SlurmctldHost=" << host << "(127.0.0.1)\n"
       << "SlurmUser=" << user << "\nSlurmdUser=" << user << "\n"
       << "AuthType=auth/munge\nCredType=cred/munge\n"
       << "AuthInfo=socket=" << at << "/munge.sock,cred_expire=5\n"
       << "SlurmctldPort=" << free_port() << "\n"
       << "SlurmctldPidFile=" << at << "/slurmctld.pid\n"
       << "SlurmdPidFile=" << at << "/slurmd-%n.pid\n"
       << "SlurmdSpoolDir=" << at << "/%n\nStateSaveLocation=" << at << "/state\n"
       << "SlurmctldLogFile=" << at << "/log/slurmctld.log\n"
       << "SlurmdLogFile=" << at << "/log/slurmd-%n.log\n"
       << "Prolog=" << at << "/prolog.sh\n"
       << "ProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\nSwitchType=switch/none\n"
       << "SelectType=select/cons_tres\nSelectTypeParameters=CR_CPU\nMpiDefault=none\n"
       << "JobAcctGatherType=jobacct_gather/none\n"
       << "SlurmdParameters=config_overrides\n"  // two nodes of two processors, whatever there is
       << "AccountingStorageType=accounting_storage/none\nReturnToService=2\n"
       << "SlurmdTimeout=" << node_seconds_
       << "\nSlurmctldTimeout=10\nInactiveLimit=0\nKillWait=2\nMinJobAge=300\n"
       << "MaxArraySize=10\n"  // small, so that a film needs several arrays
       << "SchedulerParameters=batch_sched_delay=0,sched_interval=1\n";
  for (const char* node : kNodes)
    conf << "NodeName=" << node << " NodeHostname=" << host
         << " NodeAddr=127.0.0.1 Port=" << free_port() << " CPUs=2 RealMemory=2000 State=UNKNOWN\n";
  // LLN: tasks go to the node that has less to do.
  conf << "PartitionName=farm Nodes=n1,n2 Default=YES LLN=YES MaxTime=INFINITE State=UP\n";
}

void SlurmCluster::start(const std::string& name, const std::string& command) {
  const std::string log = (folder_ / "log" / (name + ".out")).string();
  daemons_[name] = std::make_unique<BackgroundProcess>(
      words({"/bin/sh", "-c", "exec " + command + " >>" + log + " 2>&1"}));
}

void SlurmCluster::start_controller() { start("slurmctld", "/usr/sbin/slurmctld -D"); }

void SlurmCluster::stop_controller() {
  daemons_.at("slurmctld")->signal(SIGTERM);
  (void)daemons_.at("slurmctld")->wait(kStart);
  daemons_.erase("slurmctld");
}

void SlurmCluster::start_node(const std::string& name) {
  start(name, "/usr/sbin/slurmd -D -N " + name);
}

std::vector<std::string> SlurmCluster::words(const std::vector<std::string>& arguments) const {
  std::vector<std::string> all = {"/usr/bin/env",
                                  "SLURM_CONF=" + (folder_ / "slurm.conf").string()};
  all.insert(all.end(), arguments.begin(), arguments.end());
  return all;
}

ProcessResult SlurmCluster::run(const std::vector<std::string>& arguments) const {
  return run_process(words(arguments));
}

int SlurmCluster::queued(const std::string& state) const {
  std::vector<std::string> arguments = {"/usr/bin/squeue", "--noheader", "--array", "--format=%i"};
  if (state != "all") arguments.push_back("--states=" + state);
  const std::string out = run(arguments).out;
  return static_cast<int>(std::count(out.begin(), out.end(), '\n'));
}

int SlurmCluster::running_on(const std::string& node) const {
  const std::string out = run({"/usr/bin/squeue", "--noheader", "--array", "--states=RUNNING",
                               "--format=%i", "--nodelist=" + node})
                              .out;
  return static_cast<int>(std::count(out.begin(), out.end(), '\n'));
}

std::string SlurmCluster::overview() const {
  return run({"/usr/bin/squeue", "--array", "--format=%i %j %T %N (%r)"}).out +
         run({"/usr/bin/sinfo", "--Node", "--format=%N %T (%E)"}).out;
}

void SlurmCluster::set_down(const std::string& node) const {
  const ProcessResult result = run({"/usr/bin/scontrol", "update", "nodename=" + node, "state=down",
                                    "reason=killed by the test"});
  if (result.exit_code != 0) throw std::runtime_error("scontrol: " + result.err);
}

void SlurmCluster::resume_drained_nodes() const {
  const ProcessResult drained =
      run({"/usr/bin/sinfo", "--noheader", "--Node", "--states=drain", "--format=%N"});
  for (const char* node : kNodes)
    if (drained.out.find(node) != std::string::npos)
      (void)run({"/usr/bin/scontrol", "update", std::string("nodename=") + node, "state=resume"});
}

void SlurmCluster::let_launches_fail(bool fail) const {
  if (fail) {
    std::ofstream(folder_ / "launches-fail").flush();
  } else {
    fs::remove(folder_ / "launches-fail");
  }
}

std::string SlurmCluster::logs() const {
  std::string text;
  for (const auto& entry : fs::directory_iterator(folder_ / "log"))
    text += "--- " + entry.path().filename().string() + "\n" + read_text(entry.path());
  return text;
}

}  // namespace lenticule::test
