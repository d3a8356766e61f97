"""Worlds: the real code of run, guard, watchdog, recorder and drivers in virtual time, under one seed.

`python -m tests.worlds CODE` shows one; `make worlds N=1000` draws as many (see docs/explanation/safety.md).
"""
