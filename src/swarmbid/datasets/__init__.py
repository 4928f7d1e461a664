"""Readers of public benchmarks, each with the best results known. One benchmark per file."""
