"""Gravity-aided navigation: filters that match a map, the bound on them, planners over it."""
