"""What the world does: earth, vehicles, currents, inertial sensors, gravity."""
