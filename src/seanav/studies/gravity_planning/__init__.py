"""Paper 5: path planning for gravity-aided inertial navigation with the PCRB."""
