"""The robot proxy: executable ego views of a declared behaviour."""
