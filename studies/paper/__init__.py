"""The paper's tables and figures, and how far its claims carry: ``pandion reproduce``."""
