"""The MAVLink dialect `pandion`: its XML, its generator and a fast frame codec."""
