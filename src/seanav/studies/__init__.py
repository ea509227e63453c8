"""One module per paper: its scenario, its Monte-Carlo run, its scores."""
