"""Settings of DAgger."""

from __future__ import annotations

from dataclasses import dataclass

from ...config.fields import setting


@dataclass(frozen=True)
class DaggerSettings:
    """How a student is trained; with the same settings, runs differ in what their environments show alone."""

    seed: int = setting(0, "Of the network's initial weights, the episodes and their order.", 0, 2**31 - 1)
    teacher_episodes: int = setting(100, "Episodes that the teacher drives.", 1, 100_000)
    views: int = setting(24_000, "Pictures with any heading, half of them from around the target.", 1, 10_000_000)
    eye_epochs: int = setting(
        5, "Passes in which the eye learns where it is, from views and the teacher's episodes.", 0, 1000
    )
    later_eye_epochs: int = setting(
        1, "Passes of the eye after each later iteration, over all episodes and a quarter of the views.", 0, 1000
    )
    iterations: int = setting(5, "Times that the student acts and learns again, after the teacher's episodes.", 0, 1000)
    episodes: int = setting(32, "Episodes of each iteration.", 1, 100_000)
    teacher_share: float = setting(
        0.5, "Beta of the first iteration: the share of its steps that the teacher drives; it falls to 0.", 0.0, 1.0
    )
    mixed_iterations: int = setting(2, "Iterations in which the teacher drives at all.", 0, 1000)
    turns_steps: int = setting(10, "Teacher and student drive for so many steps at a time.", 1, 10_000)
    epochs: int = setting(
        24, "Passes over all episodes after each iteration, while the learning rate falls to 0.", 1, 10_000
    )
    pictures: int = setting(32, "Pictures of a batch that the eye learns from.", 1, 4096)
    sequences: int = setting(16, "Episodes that a batch walks through side by side.", 1, 1024)
    window_steps: int = setting(32, "Steps of truncated backpropagation through time.", 1, 1024)
    learning_rate: float = setting(1e-3, "Of Adam.", 1e-6, 1.0)
    sit_weight: float = setting(0.3, "Of the loss of sitting, a logit; that of the commands is 1.", 0.0, 100.0)
    seat_weight: float = setting(0.5, "Of the loss of the seat's pose.", 0.0, 100.0)
    threads: int = setting(1, "Threads of torch; the same bits come of the same number.", 1, 1024)

    def beta(self, iteration: int) -> float:
        """The share of steps that the teacher drives in ``iteration``: 1 in the 0th, 0 after the mixed ones."""
        if iteration == 0:
            return 1.0
        return self.teacher_share * max(0.0, 1.0 - (iteration - 1) / max(1, self.mixed_iterations))

    def eye_passes(self, iteration: int) -> int:
        """Passes of the eye in all, once that of ``iteration`` are made."""
        return self.eye_epochs + iteration * self.later_eye_epochs

    def rate(self, done: float) -> float:
        """The learning rate when the share ``done`` of the passes of an iteration is made: who acts has settled."""
        return self.learning_rate * (1.0 - done)
