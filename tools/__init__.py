"""What developers run beside the library: measuring, making the docs' pages and pictures."""
