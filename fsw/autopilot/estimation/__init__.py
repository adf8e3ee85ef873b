"""From sensors to the state estimate."""
