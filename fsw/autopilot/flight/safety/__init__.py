"""The safe set in force, its margins, and whether the vehicle keeps to plan and actuators obey."""
