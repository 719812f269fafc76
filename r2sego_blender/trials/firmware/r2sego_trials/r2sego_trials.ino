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
// No library is needed. 80 Hz fits 115,200 baud; a converter of 1 kHz needs a board with USB of its own, or
// 460,800 baud and `r2sego trials ... --baud`. For other converters write read_channel anew.

#include <Arduino.h>
#include <EEPROM.h>

#include "r2sego_line.h"

const char DEVICE[] = "cells-1";  // another for each board
const char FIRMWARE[] = "1.0";
const uint32_t BAUD = 115200;
const uint16_t RATE_HZ = 80;
const uint8_t DATA_PINS[] = {2, 4};
const uint8_t CLOCK_PINS[] = {3, 5};
const uint8_t EMERGENCY_PIN = 6;
const r2sego::Channel CHANNELS[] = {{"tether", -8388608, 8388607}, {"seat", -8388608, 8388607}};
const uint8_t COUNT = sizeof(CHANNELS) / sizeof(CHANNELS[0]);
const uint32_t PERIOD_US = 1000000UL / RATE_HZ;
const uint32_t WAIT_US = PERIOD_US / 4;  // the converters' own clocks are a little off

uint32_t boot = 0;
uint16_t sequence = 0;
uint32_t due_us = 0;
uint32_t hello_us = 0;
int32_t raw[COUNT] = {0};

// Counts of boots live in the EEPROM: another number after each start.
uint32_t next_boot() {
  uint32_t last;
  EEPROM.get(0, last);
  EEPROM.put(0, last + 1);
  return last + 1;
}

// 24 bits of one HX711, gain 128; false where it had none ready in time.
bool read_channel(uint8_t channel, int32_t &counts) {
  const uint32_t began_us = micros();
  while (digitalRead(DATA_PINS[channel]) == HIGH) {
    if (micros() - began_us > WAIT_US) return false;
  }
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
  counts = (int32_t)(bits ^ 0x800000UL) - 0x800000L;
  return true;
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
  due_us = micros();
  hello_us = due_us - 1000000UL;
}

void loop() {
  if ((int32_t)(micros() - due_us) < 0) return;
  due_us += PERIOD_US;
  if (micros() - hello_us >= 1000000UL) {
    hello_us = micros();
    r2sego::send_hello(Serial, DEVICE, FIRMWARE, boot, RATE_HZ, CHANNELS, COUNT);
  }
  uint8_t flags = digitalRead(EMERGENCY_PIN) == HIGH ? r2sego::EMERGENCY_STOP : 0;
  const uint32_t t_us = micros();
  for (uint8_t channel = 0; channel < COUNT; ++channel) {
    if (!read_channel(channel, raw[channel])) flags |= r2sego::SENSOR_FAULT;  // its count stays the one before
    if (raw[channel] <= CHANNELS[channel].lowest || raw[channel] >= CHANNELS[channel].highest) {
      flags |= r2sego::SATURATED;
    }
  }
  r2sego::send_sample(Serial, sequence++, t_us, raw, COUNT, flags);
}
