"""What flights show: certificates, bounds of probabilities, tails, and events too rare to count."""
