"""Where the vehicle should be: generated setpoints, offboard ones, references and their limits."""
