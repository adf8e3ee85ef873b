"""What the controllers believe about the vehicle."""
