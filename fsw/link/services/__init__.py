"""MAVLink services on one link: parameters, missions, time, and who hands them their frames."""
