"""What benchmarks make of a scene's ground truth: scores, true objects, and estimates that are off as models are."""
