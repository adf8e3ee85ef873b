"""``pandion report``: one or several flights as one self-contained HTML page."""
