"""What a flight leaves on disk."""
