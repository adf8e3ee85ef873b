"""Files that a ground station may fetch: over MAVLink FTP, and flight logs."""
