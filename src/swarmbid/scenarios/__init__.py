"""Problem generators: missions from a seed.

To add one, add a file here with a function ``make(seed, **options) -> Mission`` and ``OPTIONS``, an
instance of a frozen dataclass whose fields are the options: default, and in ``metadata["help"]`` what
each means, with its unit. It is found by the name of its file.
"""
