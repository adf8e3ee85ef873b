"""The 500 Hz control laws: plain floats in, plain floats out."""
