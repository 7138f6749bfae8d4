"""A mutation fuzzer for every file that the program reads: ``python -m tests.hostile --minutes N --seed S``.

seeds (small good files) -> mutants (edits that know the structure) -> fork_server (a child process per batch) -> exercise (what
the program does with such a file) -> outcome.  A failing mutant is minimised and kept in ``kept/``, which the tests replay.
"""
