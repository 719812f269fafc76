// A board as far as the sketch knows it: time, pins with two HX711 behind them, and a serial line.
#pragma once
#include <cstdint>
#include <cstdio>

enum { LOW, HIGH };
enum { INPUT, OUTPUT, INPUT_PULLUP };

// A converter: a count every period_us, counting up from base, until it stops.
struct Converter {
  uint8_t data_pin, clock_pin;
  int64_t period_us, stops_us;
  int32_t base;
  int64_t next_us = 0;
  int32_t conversions = 0;
  int pulses = 0;
};

extern Converter converters[2];
extern int64_t board_us;
extern int64_t pressed_us;

inline uint32_t micros() { return (uint32_t)(board_us += 4); }
inline void delayMicroseconds(unsigned us) { board_us += us; }
inline void noInterrupts() {}
inline void interrupts() {}
inline void pinMode(uint8_t, uint8_t) {}

inline int digitalRead(uint8_t pin) {
  board_us += 3;
  for (Converter &one : converters) {
    if (pin != one.data_pin) continue;
    if (one.pulses) return ((uint32_t)(one.base + one.conversions) >> (24 - one.pulses)) & 1u;
    return board_us >= one.next_us && board_us < one.stops_us ? LOW : HIGH;
  }
  return board_us >= pressed_us ? HIGH : LOW;  // the emergency contact opens
}

inline void digitalWrite(uint8_t pin, int level) {
  board_us += 3;
  for (Converter &one : converters) {
    if (pin != one.clock_pin) continue;
    if (level == HIGH) ++one.pulses;
    if (level == LOW && one.pulses == 25) {
      one.pulses = 0;
      ++one.conversions;
      while (one.next_us <= board_us) one.next_us += one.period_us;
    }
  }
}

struct Line {
  void begin(uint32_t) {}
  void write(uint8_t byte) { std::putchar(byte); }
};
extern Line Serial;
