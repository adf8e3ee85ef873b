"""Command lines of all programs: options declared once, refusals in one sentence."""
