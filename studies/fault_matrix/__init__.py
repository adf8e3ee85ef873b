"""The fault matrix: every mode with every fault, flown and compared with what must happen."""
