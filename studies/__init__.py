"""Experiments that regenerate the paper's tables and figures, without sockets."""
