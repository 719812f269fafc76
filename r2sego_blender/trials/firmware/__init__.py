"""What runs on the device: a reference sketch for Arduino-class boards, its framing, and a simulated device.

``r2sego_trials`` is the sketch's folder, as the Arduino IDE opens it: ``r2sego_line.h`` in it has the framing
alone, needs nothing of a board, and is what ``simulated_device.cpp`` sends with too. Nothing here is imported;
``line/simulated`` compiles it.
"""
