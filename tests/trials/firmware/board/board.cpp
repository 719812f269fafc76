// Runs the sketch for so long: board SECONDS TETHER_PERIOD_US SEAT_PERIOD_US SEAT_STOPS_US PRESSED_US SEAT_BASE
#include <cstdlib>

#include "r2sego_trials.ino"

int64_t board_us = 4292967296, pressed_us = 0;  // its clock wraps after two seconds
Converter converters[2] = {{2, 3, 0, INT64_MAX, -200, 0, 0, 0}, {4, 5, 0, 0, 0, 0, 0, 0}};
Line Serial;
Memory EEPROM;

int main(int, char **argv) {
  const int64_t began = board_us;
  converters[0].period_us = std::atoll(argv[2]);
  converters[1].period_us = std::atoll(argv[3]);
  converters[1].stops_us = began + std::atoll(argv[4]);
  pressed_us = began + std::atoll(argv[5]);
  converters[1].base = std::atoi(argv[6]);
  for (Converter &one : converters) one.next_us = began + one.period_us;
  setup();
  while (board_us - began < std::atoll(argv[1]) * 1000000) loop();
}
