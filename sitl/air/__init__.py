"""What air does to the vehicle, one file an effect; all of it is off unless a scenario asks."""
