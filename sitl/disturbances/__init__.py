"""What pushes the vehicle about: scenario items that add up."""
