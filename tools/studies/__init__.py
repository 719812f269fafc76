"""Studies: what a part of the method needs, told by experiments on scenes with ground truth."""
