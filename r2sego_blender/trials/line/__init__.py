"""The line between a device at a trial and this machine: bytes in, messages out, and the line's end told.

Uses ``trials/stream``, ``calibration``, ``firmware`` and ``core``; pyserial only where a port is opened. Begin with
``framing`` (what stands on the wire) and ``decoding``; ``device`` opens a port, ``adapters`` knows the kinds
of devices, ``self_test`` tries one at rest, ``simulated`` starts one without hardware.
"""
