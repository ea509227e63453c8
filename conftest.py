"""Settings for every pytest run, nbval's included, made before numpy is imported."""

import os

# One thread per library: no oversubscription, and sums in one order.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ[f"{library}_NUM_THREADS"] = "1"
# nbval compares what a cell writes: no progress bar in it (see seanav.montecarlo).
os.environ["SEANAV_PROGRESS"] = ""
