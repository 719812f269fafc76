"""SONIC's encoder and decoder, which a person brings: their inputs and outputs."""

from __future__ import annotations

from ...robot.controllers.onnx_network import NetworkLayout
from ...robot.model.unitree_g1 import JOINTS
from .sonic_layout import DECODER_SIZE, ENCODER_SIZE, TOKEN_SIZE

_CURE = "Give the ONNX file as NVIDIA released it, see docs/policy.md."

ENCODER = NetworkLayout("encoder of SONIC", _CURE, "obs_dict", ENCODER_SIZE, "encoded_tokens", TOKEN_SIZE)
DECODER = NetworkLayout("decoder of SONIC", _CURE, "obs_dict", DECODER_SIZE, "action", len(JOINTS))
