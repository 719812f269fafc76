// A device without hardware, which sends through the board's own r2sego_line.h. Run by line/simulated.py, and
// doing to the byte what line/simulated_program.py does where no compiler is.
//
//   simulated_device RATE_HZ BOOT SPEED TICKS [NAME LOWEST HIGHEST ZERO COUNTS_PER_NEWTON]...
//
// It reads a script a line from its standard input, of which the last counts, and writes to its standard output
// what a board would send, until its input ends. SPEED is how much faster than the clock it goes; TICKS, where
// not 0, how many samples it takes, without any pause. A script is
//
//   SEED EFFECT FROM_MS TO_MS, then for each channel COUNT [MS MILLINEWTONS]...
//
// the loads between whose points are straight lines, and what goes wrong from FROM_MS to TO_MS.

#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "r2sego_trials/r2sego_line.h"

namespace {

const uint32_t FIRST_US = 0u - 3000000u;  // clock and sequence wrap within the first seconds
const uint16_t FIRST_SEQUENCE = 65000;
const int32_t NOISE = 150;  // counts either way

struct Text {
  std::string bytes;
  void write(uint8_t byte) { bytes.push_back((char)byte); }
};

struct Random {  // xorshift32
  uint32_t state;
  explicit Random(uint32_t seed) : state(seed * 2654435761u | 1u) {}
  uint32_t next() {
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state >> 8;
  }
};

struct Cell {
  std::string name;
  int32_t lowest, highest, zero, counts_per_newton;
};

struct Load {
  int64_t ms, millinewtons;
};

struct Script {
  uint32_t seed = 0;
  std::string effect = "none";
  int64_t from_ms = 0, to_ms = 0;
  std::vector<std::vector<Load>> loads;
};

bool parse(const std::string &line, size_t channels, Script &script) {
  std::istringstream words(line);
  Script read;
  words >> read.seed >> read.effect >> read.from_ms >> read.to_ms;
  for (size_t channel = 0; channel < channels; ++channel) {
    size_t count = 0;
    words >> count;
    if (!words || count > 1000) return false;
    std::vector<Load> loads(count);
    for (Load &load : loads) words >> load.ms >> load.millinewtons;
    read.loads.push_back(loads);
  }
  if (!words) return false;
  script = read;
  return true;
}

int64_t load_at(const std::vector<Load> &loads, int64_t ms) {
  if (loads.empty()) return 0;
  if (ms <= loads.front().ms) return loads.front().millinewtons;
  for (size_t after = 1; after < loads.size(); ++after) {
    const Load &a = loads[after - 1], &b = loads[after];
    if (ms < b.ms) return (a.millinewtons * (b.ms - ms) + b.millinewtons * (ms - a.ms)) / (b.ms - a.ms);
  }
  return loads.back().millinewtons;
}

class Device {
 public:
  Device(uint32_t rate_hz, uint32_t boot, std::vector<Cell> cells)
      : cells_(std::move(cells)), rate_hz_(rate_hz), boot_(boot), noise_(0), damage_(0) {
    for (const Cell &cell : cells_) channels_.push_back({cell.name.c_str(), cell.lowest, cell.highest});
  }

  size_t channels() const { return cells_.size(); }

  void play(const Script &script) {
    script_ = script;
    begun_ = tick_;
    was_reset_ = false;
    noise_ = Random(script.seed);
    damage_ = Random(script.seed + 1);
  }

  // One sample's time; false when the device is gone.
  bool step(Text &out) {
    const int64_t ms = (tick_ - begun_) * 1000 / rate_hz_;
    const bool within = script_.from_ms <= ms && ms < script_.to_ms;
    const std::string effect = within ? script_.effect : "none";
    if (effect == "unplug") return false;
    if (effect == "reset" && !was_reset_) {
      was_reset_ = true;
      ++boot_;
      sequence_ = 0;
      first_us_ = 0;
      clock_ = 0;
      hello_due_ = true;
    }
    clock_ += 1000000u * (effect == "drift" ? 102u : 100u);
    hello_due_ |= tick_++ % rate_hz_ == 0;
    std::vector<int32_t> raw;
    for (size_t channel = 0; channel < cells_.size(); ++channel) {
      const int64_t newtons = load_at(script_.loads[channel], ms) * cells_[channel].counts_per_newton / 1000;
      raw.push_back((int32_t)(cells_[channel].zero + newtons + (int64_t)(noise_.next() % (2 * NOISE + 1)) - NOISE));
    }
    if (effect == "silence") return true;
    uint8_t flags = effect == "stop" ? r2sego::EMERGENCY_STOP : effect == "fault" ? r2sego::SENSOR_FAULT : 0;
    if (effect == "saturation") {
      raw.back() = cells_.back().highest;
      flags |= r2sego::SATURATED;
    }
    if (hello_due_) {
      r2sego::send_hello(out, "simulated", "1.0", boot_, (uint32_t)rate_hz_, channels_.data(), (uint8_t)channels_.size());
      hello_due_ = false;
    }
    const uint16_t sequence = sequence_++;
    if (effect == "loss" && sequence % 20 == 0) return true;
    Text line;
    const uint32_t t_us = first_us_ + (uint32_t)(clock_ / (100u * (uint64_t)rate_hz_));
    r2sego::send_sample(line, sequence, t_us, raw.data(), (uint8_t)raw.size(), flags);
    if (effect == "noise" && sequence % 7 == 0) damage(line.bytes);
    out.bytes += line.bytes;
    return true;
  }

 private:
  void damage(std::string &line) {
    const size_t at = damage_.next() % line.size();
    line[at] = (char)((uint8_t)line[at] ^ (uint8_t)(1 + damage_.next() % 255));
    for (uint32_t left = damage_.next() % 8; left; --left) line.push_back((char)(damage_.next() & 255));
  }

  std::vector<Cell> cells_;
  std::vector<r2sego::Channel> channels_;
  int64_t rate_hz_, tick_ = 0, begun_ = 0;
  uint32_t boot_, first_us_ = FIRST_US;
  uint64_t clock_ = 0;
  uint16_t sequence_ = FIRST_SEQUENCE;
  bool hello_due_ = true, was_reset_ = false;
  Script script_;
  Random noise_, damage_;
};

bool put(const std::string &bytes) {
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t wrote = write(STDOUT_FILENO, bytes.data() + done, bytes.size() - done);
    if (wrote < 0) return errno == EAGAIN || errno == EINTR;  // nobody reads: lost, as on a wire
    done += (size_t)wrote;
  }
  return true;
}

// Plays the last whole line that stands on the input; false when it ends.
bool take_scripts(Device &device, std::string &rest, bool wait) {
  bool played = false;
  pollfd input = {STDIN_FILENO, POLLIN, 0};
  while (poll(&input, 1, wait ? -1 : 0) > 0) {
    char piece[4096];
    const ssize_t size = read(STDIN_FILENO, piece, sizeof(piece));
    if (size <= 0) return false;
    rest.append(piece, (size_t)size);
    size_t end;
    Script script;
    while ((end = rest.find('\n')) != std::string::npos) {
      if (parse(rest.substr(0, end), device.channels(), script)) {
        device.play(script);
        played = true;
      }
      rest.erase(0, end + 1);
    }
    if (played) return true;
  }
  return true;
}

}  // namespace

int main(int argc, char **argv) {
  if (argc < 10 || (argc - 5) % 5) return 2;
  const int64_t rate_hz = std::atoll(argv[1]), ticks = std::atoll(argv[4]);
  const double speed = std::atof(argv[3]);
  std::vector<Cell> cells;
  for (int at = 5; at < argc; at += 5) {
    cells.push_back({argv[at], std::atoi(argv[at + 1]), std::atoi(argv[at + 2]), std::atoi(argv[at + 3]), std::atoi(argv[at + 4])});
  }
  Device device((uint32_t)rate_hz, (uint32_t)std::strtoul(argv[2], nullptr, 10), cells);
  std::string rest;
  if (rate_hz <= 0 || !take_scripts(device, rest, true)) return 2;
  const auto begun = std::chrono::steady_clock::now();
  for (int64_t tick = 0; !ticks || tick < ticks; ++tick) {
    Text out;
    if (!device.step(out) || !put(out.bytes)) return 0;
    if (ticks) continue;
    const auto due = begun + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                                 std::chrono::duration<double>((double)(tick + 1) / ((double)rate_hz * speed)));
    if (due - std::chrono::steady_clock::now() > std::chrono::milliseconds(1)) std::this_thread::sleep_until(due);
    if (!take_scripts(device, rest, false)) return 0;
  }
  return 0;
}
