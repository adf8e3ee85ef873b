"""What can go wrong in flight: conditions, the table of what is done about them, the response."""
