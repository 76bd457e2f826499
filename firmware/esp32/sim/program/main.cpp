// wheelwire-fwsim: the simulated device in real time, behind a pseudo-terminal.

#include <signal.h>
#include <sys/select.h>
#ifdef __linux__
#include <sys/prctl.h>
#endif

#include <algorithm>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>

#include "commands.hpp"
#include "console.hpp"
#include "json.hpp"
#include "options.hpp"
#include "pacer.hpp"
#include "parent.hpp"
#include "simulated_device.hpp"
#include "truth.hpp"

namespace wheelwire::sim {

namespace {

constexpr int kExitFailure = 1;
constexpr int kExitUsage = 2;

volatile sig_atomic_t g_stop_requested = 0;

extern "C" void request_stop(int) { g_stop_requested = 1; }

/// Blocks the stop signals except while waiting, so that none is missed. Returns the mask to wait
/// with.
sigset_t install_signal_handlers() {
  struct sigaction action{};
  action.sa_handler = request_stop;
  sigset_t stopping;
  sigemptyset(&stopping);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    ::sigaction(signal, &action, nullptr);
    sigaddset(&stopping, signal);
  }
  action.sa_handler = SIG_IGN;
  ::sigaction(SIGPIPE, &action, nullptr);
  sigset_t while_waiting;
  ::sigprocmask(SIG_BLOCK, &stopping, &while_waiting);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigdelset(&while_waiting, signal);
  return while_waiting;
}

/// Linux adds up to 50 us to a sleep to save power, and a byte at 921600 baud takes 11.
void ask_for_exact_timers() {
#ifdef __linux__
  ::prctl(PR_SET_TIMERSLACK, 1);
#endif
}

class Program {
 public:
  explicit Program(const Options& options)
      : while_waiting_(install_signal_handlers()),
        exit_with_stdin_(options.exit_with_stdin),
        parent_(options.parent),
        device_(options),
        truth_(options.truth_hz) {
    ask_for_exact_timers();
    console_.print(options.announcement.empty() ? ready(options) : options.announcement + "\n");
  }

  void run() {
    Pacer pacer(device_.simulator().board.now());
    while (!finished()) {
      const Ready ready = wait(pacer.until(next_event()));
      advance(pacer.behind(device_.simulator().board.now()));
      if (ready.port)
        device_.receive();  // Not sooner: it was sent now, not in the time being caught up.
      device_.simulator().service_link();
      device_.send();
      if (ready.console) obey_console();
      console_.flush();
    }
  }

 private:
  std::string ready(const Options& options) const {
    return JsonLine("ready")
        .add("port", device_.port_name())
        .add("link", options.link)
        .add("seed", options.seed)
        .add("boot_id", uint64_t{device_.simulator().boot_id()})
        .str();
  }

  bool finished() const {
    return g_stop_requested != 0 || commands_.quit() || (exit_with_stdin_ && console_.ended()) ||
           device_.host_ended() || parent_.ended();
  }

  struct Ready {
    bool console;
    bool port;
  };

  /// Sleeps for `time`, or until there is input.
  Ready wait(Nanoseconds time) {
    fd_set readable;
    FD_ZERO(&readable);
    if (!console_.ended()) FD_SET(STDIN_FILENO, &readable);
    const int port = device_.descriptor();
    if (port >= 0) FD_SET(port, &readable);
    if (parent_.descriptor() >= 0) FD_SET(parent_.descriptor(), &readable);
    const timespec timeout{.tv_sec = 0, .tv_nsec = static_cast<long>(time)};
    const int count = ::pselect(std::max({port, parent_.descriptor(), STDIN_FILENO}) + 1, &readable,
                                nullptr, nullptr, &timeout, &while_waiting_);
    if (count <= 0) return {.console = false, .port = false};
    return {.console = FD_ISSET(STDIN_FILENO, &readable) != 0,
            .port = port >= 0 && FD_ISSET(port, &readable) != 0};
  }

  /// The next time at which something happens without input.
  Nanoseconds next_event() const {
    return std::min(device_.simulator().next_event(), truth_.due());
  }

  /// Event by event, so that every change of the drive is seen, and bytes are answered when they
  /// arrive.
  void advance(Nanoseconds duration) {
    Simulator& simulator = device_.simulator();
    const Nanoseconds end = simulator.board.now() + duration;
    while (simulator.board.now() < end) {
      simulator.advance(std::min(next_event(), end) - simulator.board.now());
      simulator.service_link();
      truth_.report(simulator, console_);
    }
  }

  void obey_console() {
    console_.receive();
    while (const auto line = console_.next_line()) console_.print(commands_.run(*line));
  }

  sigset_t while_waiting_;
  bool exit_with_stdin_;
  Parent parent_;
  SimulatedDevice device_;
  TruthStream truth_;
  Console console_;
  Commands commands_{device_};
};

int run(int argc, char** argv) {
  try {
    const Options options = parse_options(argc, argv);
    if (options.help) {
      std::fputs(help_text().c_str(), stdout);
      return 0;
    }
    Program(options).run();
    return 0;
  } catch (const std::invalid_argument& error) {
    std::fprintf(stderr, "wheelwire-fwsim: %s\n", error.what());
    return kExitUsage;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "wheelwire-fwsim: %s\n", error.what());
    return kExitFailure;
  }
}

}  // namespace

}  // namespace wheelwire::sim

int main(int argc, char** argv) { return wheelwire::sim::run(argc, argv); }
