"""The concealment proof: effects are hidden by an independent simulator, sealed, and must be found again."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the console script does, before numpy is imported
