"""The steps of an uploaded mission, and the way between its places."""
