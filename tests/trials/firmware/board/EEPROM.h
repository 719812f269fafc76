#pragma once
#include <cstdint>

struct Memory {
  uint32_t held = 0xFFFFFFFFu;  // as it is new
  void get(int, uint32_t &value) { value = held; }
  void put(int, uint32_t value) { held = value; }
};
extern Memory EEPROM;
