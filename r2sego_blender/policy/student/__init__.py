"""The student: a recurrent network that sees what the head sees and says what the robot does next.

Uses ``environment`` for the true states that its auxiliary targets are made of; all but ``targets`` needs torch.
Begin with ``network``; ``onnx_export`` makes of it what runs as a controller.
"""
