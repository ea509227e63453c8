"""What the benchmarks share. CPU time beside wall time: it counts on a busy machine too."""

import time
from collections.abc import Callable


def best_of(function: Callable[[], object], repeats: int = 5) -> tuple[float, float]:
    """Return the least wall and CPU time of several calls, s; the first call compiles."""
    function()
    times = []
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        function()
        times.append((time.perf_counter() - wall, time.process_time() - cpu))
    return min(wall for wall, _ in times), min(cpu for _, cpu in times)
