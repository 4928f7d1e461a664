"""One paper or study per file: what was reported, and what we find.

Each has a function ``run(...)``, which the command line calls, and returns figures that can be printed,
written to a page and read by a program.
"""
