"""`hil` and `python -m hil`."""

import os
import sys

from hil.cli.app import main as run

# Fits multiply small matrices in threads of their own. A threaded BLAS beneath them waits for cores that are
# busy: with other work on both cores one fit took 18 s instead of 1. Read when numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def main() -> None:
    """Entry point of the console script."""
    sys.exit(run())


if __name__ == "__main__":
    main()
