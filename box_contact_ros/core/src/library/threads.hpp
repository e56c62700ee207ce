// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Work in as many threads as are asked for.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

namespace box_contact::detail {

// A thread looks so many times before it gives its core away: some 50 µs, as long as another takes to wake.
constexpr int looks = 2000;

// Whether a condition holds within a moment.
template <class Condition>
bool holds_soon(const Condition& holds) {
  for (int k = 0; k < looks; ++k) {
    if (holds()) return true;
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    asm volatile("yield");
#endif
  }
  return holds();
}

// More threads than this are refused: a number that no machine's cores ask for is a mistake.
constexpr int threads_max = 1024;

// Threads that begin when they first have work, and are kept. Between calls they look for more for a
// moment, and then sleep.
class Threads {
 public:
  Threads() = default;
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;
  ~Threads() {
    if (!is_of_this_process()) {
      leave();
      return;
    }
    call(-1, nullptr, nullptr);
    for (std::thread& thread : kept_->threads) thread.join();
  }

  // Call `work(thread, chunk)` for each chunk. A thread takes the next chunk until none is left: one that
  // starts late costs little. A single thread is the caller's, and takes no memory.
  template <class Work>
  void operator()(long threads, long chunks, const Work& work) {
    std::atomic<long> next{0};
    auto work_on = [&](long thread) {
      for (long chunk = next++; chunk < chunks; chunk = next++) work(thread, chunk);
    };
    using WorkOn = decltype(work_on);
    threads = begin(std::min(threads, chunks));
    if (threads > 1)
      call(
          threads, [](const void* all, long thread) { (*static_cast<const WorkOn*>(all))(thread); },
          &work_on);
    work_on(0L);
    if (threads > 1) await_end();
  }

 private:
  // What a call asks of the first threads; below 0 they end.
  struct Call {
    long threads;
    void (*work)(const void* all, long thread);
    const void* all;
  };
  struct Kept {
    std::vector<std::thread> threads;
    std::mutex mutex;
    std::condition_variable begins, ends;
    std::atomic<long> turn{0};     // of calls
    std::atomic<long> working{0};  // threads in the last one
    Call call{};
    pid_t process = getpid();
  };

  // Begin threads, with the caller's. Returns how many there are: no more than cores, and fewer where the
  // machine has no memory for them.
  long begin(long threads) {
    static const long cores = std::max(1L, long(std::thread::hardware_concurrency()));
    threads = std::min(threads, cores);
    if (threads <= 1) return 1;
    if (!is_of_this_process()) {
      leave();
      kept_ = std::make_unique<Kept>();
    }
    try {
      kept_->threads.reserve(size_t(threads - 1));
      while (long(kept_->threads.size()) < threads - 1)
        kept_->threads.emplace_back(serve, std::ref(*kept_), long(kept_->threads.size()) + 1);
    } catch (const std::exception&) {
      threads = long(kept_->threads.size()) + 1;
    }
    return threads;
  }
  bool is_of_this_process() const { return kept_ && kept_->process == getpid(); }
  // A process that forked has the threads, and whatever they hold.
  void leave() { static_cast<void>(kept_.release()); }
  void call(long threads, void (*work)(const void*, long), const void* all) {
    {
      std::lock_guard<std::mutex> lock(kept_->mutex);
      kept_->call = {threads, work, all};
      kept_->working = threads - 1;
      ++kept_->turn;
    }
    kept_->begins.notify_all();
  }
  void await_end() {
    auto is_over = [this] { return kept_->working == 0; };
    if (holds_soon(is_over)) return;
    std::unique_lock<std::mutex> lock(kept_->mutex);
    kept_->ends.wait(lock, is_over);
  }
  static void serve(Kept& kept, long thread) {
    for (long turn = 0;;) {
      auto is_called = [&] { return kept.turn != turn; };
      holds_soon(is_called);
      std::unique_lock<std::mutex> lock(kept.mutex);
      kept.begins.wait(lock, is_called);
      turn = kept.turn;
      Call call = kept.call;
      lock.unlock();
      if (call.threads < 0) return;
      if (thread >= call.threads) continue;
      call.work(call.all, thread);
      lock.lock();
      if (--kept.working == 0) kept.ends.notify_one();
    }
  }

  std::unique_ptr<Kept> kept_;
};

}  // namespace box_contact::detail
