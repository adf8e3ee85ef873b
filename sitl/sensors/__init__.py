"""What the vehicle can measure: truth, delayed and with noise."""
