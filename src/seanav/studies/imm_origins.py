"""Paper 4: where each parameter comes from, and what the claims are."""

# name: (unit, origin, note)
_ORIGINS = {
    "runs": ("", "text", "100 per point"),
    "seed": ("", "assumed", ""),
    "duration_s": ("s", "text", ""),
    "speed_kn": ("kn", "text", ""),
    "latitude_deg": ("deg", "text", ""),
    "longitude_deg": ("deg", "text", ""),
    "trajectory": (
        "",
        "derived",
        "the shape that explains Tables 2 and 3; chosen by looking at them",
    ),
    "corner_radius": ("m", "derived", "as the trajectory; of little effect"),
    "sides": ("", "assumed", "of polygon and laps only"),
    "laps": ("", "assumed", "of laps only"),
    "accelerometer_bias_mg": ("mg", "text", "Table 1; read as 1 sigma per run and axis: assumed"),
    "accelerometer_noise_mg": ("mg/√Hz", "text", "Table 1"),
    "gyro_bias_deg_h": ("deg/h", "text", "Table 1; read as 1 sigma per run and axis: assumed"),
    "gyro_noise_deg_sqrt_h": ("deg/√h", "text", "Table 1"),
    "log_noise": ("m/s", "text", "Table 1"),
    "log_axes": ("", "text", "the forward axis"),
    "correlation_time_s": ("s", "text", "of the filters; of the truth: assumed the same"),
    "sigma_true": ("m/s", "assumed", "the paper's grid ends at 0.05 and 1"),
    "sigma_filter": ("m/s", "text", ""),
    "initial_current": ("", "derived", "chosen by looking at Tables 2 and 3"),
    "initial_errors": ("", "derived", "near perfect start; chosen by looking at Tables 2 and 3"),
    "initial_position_m": ("m", "derived", "near perfect start"),
    "initial_velocity": ("m/s", "derived", "near perfect start"),
    "initial_tilt_rad": ("rad", "derived", "near perfect start"),
    "initial_heading_rad": ("rad", "derived", "near perfect start"),
    "fading_form": ("", "derived", "(17) read literally diverges; chosen by looking at the tables"),
    "fading_window": ("", "text", ""),
    "fading_cap": ("", "assumed", "bounds the first steps of the window"),
    "transition": ("", "assumed", "damaged in print; 0.9 is the likely reading"),
    "initial_probabilities": ("", "text", ""),
}


def origins(scenario):
    """Return the rows of the parameter table."""
    rows = []
    for name, (unit, origin, note) in _ORIGINS.items():
        value = getattr(scenario, name)
        text = " ".join(f"{x}" for x in value) if isinstance(value, tuple) else value
        rows.append((name, text, unit, origin, *([note] if note else [])))
    return rows


CLAIMS = tuple(f"4.{k}" for k in range(1, 18))
