"""What a person looks at: a flight from its log or live from its telemetry, as a page."""
