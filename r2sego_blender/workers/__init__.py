"""What runs in a process of its own: native code that can abort, and learned models."""
