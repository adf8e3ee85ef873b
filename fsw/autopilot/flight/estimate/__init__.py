"""From the sensors of a tick to the state estimate that it flies by, and what is told of it."""
