"""One algorithm per file, its sources in its docstring; the file's name is the algorithm's name."""
