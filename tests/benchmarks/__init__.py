"""How fast every part is, beside the plain implementation and beside what bounds it: ``python -m tests.benchmarks``."""
