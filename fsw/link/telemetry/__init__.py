"""What is sent to the ground, how often, and what changes that."""
