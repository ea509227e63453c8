"""The property tests draw the same examples on every machine: a change breaks them, not chance."""

from hypothesis import settings

settings.register_profile("same", derandomize=True)
settings.load_profile("same")
