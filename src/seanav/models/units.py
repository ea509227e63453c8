"""Units that appear at the edges, in SI: multiply to come in, divide to go out."""

KM = 1e3  # m
KNOT = 1852.0 / 3600.0  # m/s
G0 = 9.80665  # m/s², one standard gravity
MGAL = 1e-5  # m/s²
