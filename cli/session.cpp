// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/session.h"

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "diagnostics/error.h"
#include "files/atomic_file.h"

namespace interglow::cli {
namespace {

std::atomic<bool> stop_requested{false};

extern "C" void request_stop(int) { stop_requested = true; }

/// One line on stderr that rewrites itself; nothing where stderr is not a terminal.
class ProgressBar {
 public:
  void show(std::string_view stage, double fraction) {
    const std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (stage != stage_) {
      stage_ = stage;
      start_ = now;
    } else if (fraction < 1.0 && now - drawn_ < std::chrono::milliseconds(100)) {
      return;
    }
    drawn_ = now;
    const double elapsed_s = std::chrono::duration<double>(now - start_).count();
    std::string left;
    if (fraction > 0.02 && fraction < 1.0 && elapsed_s > 1.0) {
      left = fmt::format("  {:.0f} s left", elapsed_s * (1.0 - fraction) / fraction);
    }
    constexpr int kWidth = 30;
    const int done = static_cast<int>(fraction * kWidth + 0.5);
    fmt::print(stderr, "\r\033[K{:<22} [{:#>{}}{:.>{}}] {:3.0f} %{}", stage_, "", done, "", kWidth - done,
               100.0 * fraction, left);
    std::fflush(stderr);
    drawn_once_ = true;
  }
  void clear() {
    const std::lock_guard lock(mutex_);
    if (drawn_once_) fmt::print(stderr, "\r\033[K");
    drawn_once_ = false;
    std::fflush(stderr);
  }

 private:
  std::mutex mutex_;
  std::string stage_;
  std::chrono::steady_clock::time_point start_{}, drawn_{};
  bool drawn_once_ = false;
};

/// What work does not ask whether to stop within this, is not waited for.
constexpr std::chrono::milliseconds kGrace{700};

/// Ends the process on Ctrl-C where the work does not end by itself: inside a library's call, or between two askings
/// far apart.
class Watchdog {
 public:
  explicit Watchdog(ProgressBar& bar) : thread_([&bar](const std::stop_token& done) { watch(bar, done); }) {}

 private:
  static void watch(ProgressBar& bar, const std::stop_token& done) {
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable_any ended;  // woken by `done` alone: a signal handler may not wake it
    while (!stop_requested && !done.stop_requested())
      ended.wait_for(lock, done, std::chrono::milliseconds(50), [] { return false; });
    ended.wait_for(lock, done, kGrace, [] { return false; });
    if (done.stop_requested()) return;
    files::abandon_unfinished();
    bar.clear();
    fmt::print(stderr, "interglow: stopped; nothing was left half-written.\n");
    _exit(kInterrupted);
  }

  std::jthread thread_;
};

}  // namespace

void add_session_options(CLI::App& command, Session& session) {
  command.add_option("--threads", session.threads, "Number of threads; 0 uses all cores")
      ->capture_default_str()
      ->check(CLI::Range(0, 4096));
  command.add_flag("--quiet", session.quiet, "No progress bar");
}

int run_guarded(Session& session, const std::function<int()>& action) {
  ProgressBar bar;
  session.progress.cancelled = [] { return stop_requested.load(); };
  if (!session.quiet && isatty(STDERR_FILENO) != 0) {
    session.clear_progress = [&bar] { bar.clear(); };
    session.progress.report = [&bar](std::string_view stage, double fraction) { bar.show(stage, fraction); };
  }
  std::signal(SIGINT, &request_stop);
  std::signal(SIGTERM, &request_stop);
  const Watchdog watchdog(bar);
  std::optional<tbb::global_control> limit;
  if (session.threads > 0) {
    limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(session.threads));
  }
  const auto fail = [&bar](const std::string& message, int status) {
    bar.clear();
    fmt::print(stderr, "interglow: {}\n", message);
    return status;
  };
  try {
    const int status = action();
    bar.clear();
    return status;
  } catch (const InvalidInput& error) {
    return fail(error.what(), kBadInput);
  } catch (const InvalidParams& error) {
    return fail(error.what(), kBadInput);
  } catch (const Cancelled& error) {
    return fail(std::string(error.what()) + "; nothing was left half-written.", kInterrupted);
  } catch (const std::bad_alloc&) {
    return fail("out of memory. Ask for fewer patches or a coarser tolerance.", kFailure);
  } catch (const std::exception& error) {
    return fail(error.what(), kFailure);
  }
}

}  // namespace interglow::cli
