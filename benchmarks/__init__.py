"""Speed, measured as ratios in one run: `python -m benchmarks [--quick] [--write PAGE] [name ...]`."""
