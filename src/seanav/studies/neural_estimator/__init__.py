"""Paper 2: the neural state estimator and its teacher."""
