"""Paper 3: Kalman filters with fading factors under actuator faults of an AUV."""
