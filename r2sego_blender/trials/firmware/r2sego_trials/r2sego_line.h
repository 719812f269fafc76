// The framing of R2S-EGO's line for trials: what a device sends, in ASCII, each line with its own check.
//
//   $seq,t_us,raw...,flags*CRC\r\n                                   a sample
//   !1,device,firmware,boot,rate_hz,name,lowest,highest...*CRC\r\n   a hello, at the start and once a second
//
// seq        counts samples, 0 to 65535, then 0 again; a sample that could not be sent is counted too
// t_us       the device's clock in microseconds, 32 bits, then 0 again
// raw        a whole number of 32 bits for each of 1 to 8 channels: counts of the converter, not scaled
// flags      1 the emergency circuit is open, 2 a channel is at an end of its range, 4 a channel was not read
// device, firmware, name   words of A-Z a-z 0-9 _ . - of at most 24 letters; a name at most 16, a letter first
// boot       another number after each start of the device
// CRC        CRC-16/CCITT-FALSE (0x1021 from 0xFFFF; "123456789" gives 29B1), four hexadecimal digits, over
//            what stands between the first character and the *
//
// A Sink is whatever has write(uint8_t): Serial on a board. Nothing is kept in memory, nothing is allocated.
// The whole protocol is described in r2sego_blender/trials/line/framing.py.

#ifndef R2SEGO_LINE_H
#define R2SEGO_LINE_H

#include <stdint.h>

namespace r2sego {

const uint8_t EMERGENCY_STOP = 1;
const uint8_t SATURATED = 2;
const uint8_t SENSOR_FAULT = 4;

struct Channel {
  const char *name;
  int32_t lowest;
  int32_t highest;
};

inline uint16_t crc(uint16_t sum, uint8_t byte) {
  sum ^= (uint16_t)((uint16_t)byte << 8);
  for (uint8_t bit = 0; bit < 8; ++bit) {
    sum = (sum & 0x8000u) ? (uint16_t)((sum << 1) ^ 0x1021u) : (uint16_t)(sum << 1);
  }
  return sum;
}

template <class Sink>
class Line {
 public:
  Line(Sink &sink, char start) : sink_(sink), sum_(0xFFFF), first_(true) { sink_.write((uint8_t)start); }

  void word(const char *text) {
    separate();
    while (*text) put(*text++);
  }

  void counter(uint32_t value) {
    separate();
    digits(value);
  }

  void number(int32_t value) {
    separate();
    if (value < 0) put('-');
    digits(value < 0 ? 0u - (uint32_t)value : (uint32_t)value);
  }

  void end() {
    sink_.write((uint8_t)'*');
    for (int8_t shift = 12; shift >= 0; shift -= 4) sink_.write((uint8_t)"0123456789ABCDEF"[(sum_ >> shift) & 15u]);
    sink_.write((uint8_t)'\r');
    sink_.write((uint8_t)'\n');
  }

 private:
  void separate() {
    if (!first_) put(',');
    first_ = false;
  }

  void digits(uint32_t value) {
    char text[10];
    uint8_t count = 0;
    do {
      text[count++] = (char)('0' + value % 10u);
      value /= 10u;
    } while (value);
    while (count) put(text[--count]);
  }

  void put(char letter) {
    sum_ = crc(sum_, (uint8_t)letter);
    sink_.write((uint8_t)letter);
  }

  Sink &sink_;
  uint16_t sum_;
  bool first_;
};

template <class Sink>
void send_sample(Sink &sink, uint16_t sequence, uint32_t t_us, const int32_t *raw, uint8_t channels, uint8_t flags) {
  Line<Sink> line(sink, '$');
  line.counter(sequence);
  line.counter(t_us);
  for (uint8_t channel = 0; channel < channels; ++channel) line.number(raw[channel]);
  line.counter(flags);
  line.end();
}

template <class Sink>
void send_hello(Sink &sink, const char *device, const char *firmware, uint32_t boot, uint32_t rate_hz,
                const Channel *channels, uint8_t count) {
  Line<Sink> line(sink, '!');
  line.counter(1);
  line.word(device);
  line.word(firmware);
  line.counter(boot);
  line.counter(rate_hz);
  for (uint8_t channel = 0; channel < count; ++channel) {
    line.word(channels[channel].name);
    line.number(channels[channel].lowest);
    line.number(channels[channel].highest);
  }
  line.end();
}

}  // namespace r2sego

#endif
