"""What the vehicle can measure, one file a sensor."""
