"""What developers run beside the library: measuring, rooms to measure on, making the docs' pages and pictures."""
