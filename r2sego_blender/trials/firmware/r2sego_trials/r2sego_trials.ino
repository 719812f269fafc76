// Reference sketch: two load cells on HX711 converters and the auxiliary contact of an emergency button.
//
// This board records that the emergency circuit is open. It does not open it: the emergency stop is a circuit
// of its own that cuts the robot's power whatever this board, its cable or the computer do.
//
//   pin 2, 3    data and clock of the HX711 at the tether (RATE pin high: 80 Hz)
//   pin 4, 5    data and clock of the HX711 under the seat (likewise)
//   pin 6       a contact of the emergency button that is closed while the circuit is, to ground: a cut wire
//               reads as pressed
//
// A sample is sent with each conversion at the tether, whose own clock says when; the seat's count is its newest.
// No library is needed. 80 Hz fits 115,200 baud; a converter of 1 kHz needs a board with USB of its own, or
// 460,800 baud and `--baud 460800`. For other converters write is_ready and read_counts anew; a board without
// EEPROM wants another next_boot.

#include <Arduino.h>
#include <EEPROM.h>

#include "r2sego_line.h"

const char DEVICE[] = "cells-1";  // another for each board
const char FIRMWARE[] = "1.0";
const uint32_t BAUD = 115200;
const uint8_t DATA_PINS[] = {2, 4};
const uint8_t CLOCK_PINS[] = {3, 5};
const uint8_t EMERGENCY_PIN = 6;
const r2sego::Channel CHANNELS[] = {{"tether", -8388608, 8388607}, {"seat", -8388608, 8388607}};
const uint8_t COUNT = sizeof(CHANNELS) / sizeof(CHANNELS[0]);
const uint32_t SECOND_US = 1000000UL;
const uint32_t STALE_US = 40000UL;  // three conversions at 80 Hz

uint32_t boot = 0;
uint32_t rate_hz = 0;
uint16_t sequence = 0;
uint32_t hello_us = 0;
uint32_t sent_us = 0;
uint32_t read_us[COUNT] = {0};
int32_t raw[COUNT] = {0};

// Counts of boots live in the EEPROM: another number after each start.
uint32_t next_boot() {
  uint32_t last;
  EEPROM.get(0, last);
  EEPROM.put(0, last + 1);
  return last + 1;
}

bool is_ready(uint8_t channel) { return digitalRead(DATA_PINS[channel]) == LOW; }

// 24 bits of an HX711 that is ready, gain 128.
int32_t read_counts(uint8_t channel) {
  uint32_t bits = 0;
  noInterrupts();  // a clock pulse of more than 60 us sends the converter to sleep
  for (uint8_t bit = 0; bit < 25; ++bit) {  // the 25th asks for gain 128 next time
    digitalWrite(CLOCK_PINS[channel], HIGH);
    delayMicroseconds(1);
    if (bit < 24) bits = (bits << 1) | (digitalRead(DATA_PINS[channel]) == HIGH ? 1u : 0u);
    digitalWrite(CLOCK_PINS[channel], LOW);
    delayMicroseconds(1);
  }
  interrupts();
  return (int32_t)(bits ^ 0x800000UL) - 0x800000L;
}

// Takes what is ready; whether the tether was.
bool read_channels() {
  bool tether = false;
  for (uint8_t channel = 0; channel < COUNT; ++channel) {
    if (!is_ready(channel)) continue;
    raw[channel] = read_counts(channel);
    read_us[channel] = micros();
    tether |= channel == 0;
  }
  return tether;
}

void setup() {
  Serial.begin(BAUD);
  for (uint8_t channel = 0; channel < COUNT; ++channel) {
    pinMode(DATA_PINS[channel], INPUT);
    pinMode(CLOCK_PINS[channel], OUTPUT);
    digitalWrite(CLOCK_PINS[channel], LOW);
  }
  pinMode(EMERGENCY_PIN, INPUT_PULLUP);
  boot = next_boot();
  const uint32_t began_us = micros();
  while (micros() - began_us < SECOND_US) rate_hz += read_channels() ? 1 : 0;  // converters' clocks are 10 % off
  if (rate_hz == 0) rate_hz = 1;  // no converter: the samples will say so
  sent_us = micros();
  hello_us = sent_us - SECOND_US;
}

void loop() {
  if (micros() - hello_us >= SECOND_US) {
    hello_us += SECOND_US;
    r2sego::send_hello(Serial, DEVICE, FIRMWARE, boot, rate_hz, CHANNELS, COUNT);
  }
  const bool tether = read_channels();
  const uint32_t now_us = micros();
  if (!tether && now_us - sent_us < STALE_US) return;
  sent_us = now_us;
  uint8_t flags = digitalRead(EMERGENCY_PIN) == HIGH ? r2sego::EMERGENCY_STOP : 0;
  for (uint8_t channel = 0; channel < COUNT; ++channel) {
    if (now_us - read_us[channel] >= STALE_US) flags |= r2sego::SENSOR_FAULT;  // its count stays the one before
    if (raw[channel] <= CHANNELS[channel].lowest || raw[channel] >= CHANNELS[channel].highest) {
      flags |= r2sego::SATURATED;
    }
  }
  r2sego::send_sample(Serial, sequence++, now_us, raw, COUNT, flags);
}
