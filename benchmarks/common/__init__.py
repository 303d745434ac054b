"""What all benchmarks share: scene, times, judge, tables."""
